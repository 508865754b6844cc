"""Paths by stresses print one line when the load falls from its largest value, with a remedy."""

import pytest
from mpi4py import MPI

from feti_homog.analysis import runner
from feti_homog.case import cases
from feti_homog.system.runtime.standard_streams import Progress


@pytest.mark.parametrize("to", [{"S22": 100.0}, {"S11": -1.0, "S22": 90.0}, {"E22": 0.01}])
def test_a_load_that_falls_from_its_largest_value_has_one_line(to, tmp_path, monkeypatch):
    cohesive = {"normal_stiffness": 1e5, "tangential_stiffness": 1e5, "normal_toughness": 0.02}
    document = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.15},
        "material": {"matrix": {"young": 4e3, "poisson": 0.35}, "fibre": {"young": 7e4, "poisson": 0.2}},
        "analysis": {"type": "path", "plane": "strain"},
        "interface": cohesive
        | {"law": "bilinear", "normal_strength": 60.0, "tangential_strength": 85.0, "tangential_toughness": 0.04},
        "path": {"to": to, "max_events": 100},
        "output": {"fields": False, "pictures": False},
    }
    lines = []
    monkeypatch.setattr(Progress, "say", lambda self, line: lines.append(line))
    result = runner.run(cases.parse(document, tmp_path), tmp_path / "out", Progress(MPI.COMM_SELF, True))
    printed = [line for line in lines if "largest value so far" in line]
    if "E22" in to:  # the strain prescribes where the path ends
        assert printed == [] and not any("jumps" in line for line in result.remarks)
        return
    load = [point.load_factor for point in result.path]
    first = next(k for k in range(len(load)) if load[k] < 0.95 * max(load[: k + 1]))
    top = max(result.path[:first], key=lambda point: point.load_factor)
    (line,) = printed
    place = f"at {top.load_factor:.6f}, E22 {top.strain[1]:.4g}, S22 {top.stress[1]:.4g}"
    assert f"{place}; the path ends at load factor 1" in line and "prescribed strain" in line
    assert f"[path] under a load that only rises, the strain jumps {place}" in result.remarks
