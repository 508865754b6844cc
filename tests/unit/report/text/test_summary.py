import copy
from typing import Any

import pytest

from feti_homog.report.text.summary import summary

DOCUMENT: dict[str, Any] = {
    "version": "0",
    "case": {
        "name": "pair",
        "cell": {"geometry": "hexagonal", "order": 2, "refine": 1},
        "analysis": {"type": "stiffness", "plane": "strain"},
        "output": {"length_unit": "mm", "stress_unit": "GPa"},
    },
    "cell": {
        "width": 1.0, "height": 1.7320508, "area": 1.7320508, "fibre_fraction": 0.4,
        "elements": 12345, "nodes": 6300,
        "fractions": {"matrix": 0.6, "fibre": 0.4},
    },
    "solver": {
        "ranks": 1, "subdomains": 3, "dofs": 12600, "multipliers": 400, "kernel_dim": 8,
        "coarse_dim": 8, "iterations": [12, 12, 11], "converged_reason": [2, 2, 2],
    },
    "effective_stiffness": [[149.69, 56.97, 1e-13], [56.97, 149.69, 0.0], [-1e-13, 0.0, 46.36]],
    "moduli": {"E1": 128.0, "E2": 128.0, "nu12": 0.38, "nu21": 0.38, "G12": 46.36, "eta1": 1e-16,
               "bulk": 103.33, "shear": 46.36},
    "bounds": {
        "voigt": [[160.0, 60.0, 0.0], [60.0, 160.0, 0.0], [0.0, 0.0, 53.0]],
        "reuss": [[140.0, 50.0, 0.0], [50.0, 140.0, 0.0], [0.0, 0.0, 44.0]],
        "hashin_shtrikman": {"bulk": [103.3, 104.8], "shear": [46.2, 47.6]},
    },
    "checks": {"strain": 1e-15, "hill": 2e-12, "jump": 3e-6},
    "check_tolerance": 1e-7,
    "timings": {"mesh": 0.5, "solve": 1.23, "assemble": 0.25, "factor": 0.31, "output": 0.4, "cut": 0.01},
    "memory": 200 * 2**20,
    "warnings": ["the matrix is nearly incompressible in plane strain: P1 elements lock, so take order = 2"],
    "status": "done",
}  # fmt: skip


def changed(**top: Any) -> dict[str, Any]:
    return copy.deepcopy(DOCUMENT) | top


def line(text: str, start: str) -> str:
    return next(line for line in text.splitlines() if line.strip().startswith(start))


def test_stiffnesses_in_space_are_narrow_and_say_what_temperature_does() -> None:
    C = [[161.25, 45.39, 40.33, 0, 0, -1e-9], [45.39, 161.26, 40.33, 0, 0, 0], [40.33, 40.33, 229.45, 0, 0, 0],
         [0, 0, 0, 54.26, 0, 0], [0, 0, 0, 0, 54.27, 0], [-1e-9, 0, 0, 0, 0, 46.05]]  # fmt: skip
    thermal = {"thermal_stress": [-3e-3, -3e-3, -4e-3, 0.0, 0.0, 1e-15], "thermal_expansion": [1.7e-5] * 3 + [0.0] * 3}
    document = changed(effective_stiffness=C) | thermal
    document["case"]["analysis"]["plane"] = "generalized"
    text = summary(document)
    assert max(map(len, text.splitlines())) < 80
    assert line(text, "E11").split() == ["E11", "E22", "E33", "gamma23", "gamma13", "gamma12"]
    assert line(text, "S33").split() == ["S33", "40.3300", "40.3300", "229.4500", "0.0000", "0.0000", "0.0000"]
    assert line(text, "S12").split()[1] == "0.0000"
    assert line(text, "33").split() == ["33", "-0.004", "1.7e-05"] and line(text, "12").split() == ["12", "0", "0"]


def test_the_summary_says_what_was_computed() -> None:
    text = summary(DOCUMENT)
    assert line(text, "S22").split() == ["S22", "56.97000", "149.69000", "0.00000"]
    assert line(text, "S11").split()[-1] == "0.00000"
    assert line(text, "Solver") == "Solver      1 rank, 3 subdomains, 12 600 dofs"
    assert line(text, "Iterations").endswith("12, 12, 11")
    assert "fibre fraction 0.400000 (matrix 0.600000, fibre 0.400000)" in text
    assert line(text, "E1").split() == ["E1", "128", "nu12", "0.380000"]
    assert line(text, "bulk H").split()[-3:] == ["103.3", "103.33", "104.8"]
    assert line(text, "C11 Reuss").split()[-3:] == ["140", "149.69", "160"] and "outside" not in text
    assert line(text, "Memory").endswith("200 MiB per rank at most")
    assert "Effective stiffness (GPa)" in text and "1.73205 mm" in text
    assert line(text, "Status").split() == ["Status", "done"]


@pytest.mark.parametrize(("entry", "text"), [(2.0e11, "2.0000000e+11"), (0.5, "0.50000000"), (12345.678, "12345.678")])
def test_stiffnesses_of_any_size_fit_the_columns(entry: float, text: str) -> None:
    stiffness = [[entry, 0.0, 0.0], [0.0, entry, 0.0], [0.0, 0.0, entry]]
    lines = summary(changed(effective_stiffness=stiffness)).splitlines()
    assert next(words for words in lines if words.startswith("  S11")).split()[1].startswith(text)
    assert max(map(len, lines)) < 80


def test_checks_beyond_the_tolerance_fail() -> None:
    text = summary(DOCUMENT)
    assert line(text, "hill").split() == ["hill", "2.0e-12", "pass"]
    assert line(text, "jump").split() == ["jump", "3.0e-06", "FAIL"]
    document = changed()
    del document["check_tolerance"]
    assert line(summary(document), "jump").split() == ["jump", "3.0e-06"]


def test_remarks_warnings_and_faults_are_reported_in_this_order() -> None:
    text = summary(changed(faults=["check jump: 3e-06"], status="not converged"))
    assert "Warning     the matrix" in text and "Fault       check jump: 3e-06" in text
    assert "Warning" not in summary(changed(warnings=[]))
    text = summary(changed(remarks=["a stress is free"], warnings=["it locks"], faults=["no convergence"]))
    places = [text.index(word) for word in ("a stress is free", "it locks", "no convergence")]
    assert places == sorted(places)


def test_what_is_unknown_is_left_out() -> None:
    document = changed(something_else={"a": 1})
    document["case"] |= {"output": {}, "cell": {"geometry": "hexagonal", "order": 2, "accuracy": 0.01}}
    document["cell"] |= {"refine": 2, "mesh_size": 0.05}
    document["bounds"]["hashin_shtrikman"] = None
    document["effective_stiffness"][1][1] = 161.0
    text = summary(document)
    assert "GPa" not in text and "Hashin" not in text and "()" not in text
    assert "refine 2 of mesh_size 0.05 for accuracy = 0.01" in " ".join(text.split())
    assert [row.split()[-1] for row in text.splitlines() if "Reuss, Voigt" in row] == ["160", "outside", "53"]


def counted(bonded: int, **values: Any) -> dict[str, Any]:
    return values | {"bonded": bonded, "open": 9, "closed": 1, "iterations": 7}


@pytest.mark.parametrize("size", [3, 6])
def test_an_angle_is_a_table_of_stiffnesses(size: int) -> None:
    stiffness = [[9.0, 2, 0], [2, 8, 0], [0, 0, 3]]
    if size == 6:
        stiffness = [[10.0 * min(i, j) + max(i, j) for j in range(1, 7)] for i in range(1, 7)]
    document = changed(angle=[counted(20 - k, angle=90.0 * k, stiffness=stiffness) for k in (0, 4)])
    del document["effective_stiffness"], document["moduli"], document["bounds"]
    document["case"]["analysis"]["type"] = "angle"
    text = summary(document)
    assert text.startswith("pair: debonding angle, plane strain") and max(map(len, text.splitlines())) < 80
    head, numbers = (line(text, start).split() for start in ("angle ", "360 "))
    # Each of the three unit strains opens and closes other nodes.
    words = "C33: shear; bonded, open, closed: interface nodes under the unit strain gamma12"
    assert (words in text) == (size == 3)
    if size == 6:
        assert numbers == ["360", *(name.removeprefix("C") for name in head[1:])] and len(numbers) == 8
    else:
        assert head == ["angle", "C11", "C22", "C12", "C33", "bonded", "open", "closed"]
        assert numbers == ["360", "9", "8", "2", "3", "16", "9", "1"]


def test_a_path_is_a_table_of_chosen_points() -> None:
    points = [
        counted(100 - k, load_factor=0.01 * k, strain=[0, -2e-3 * k, 1e-5], stress=[1e-15, -3.5 * k, -2.0], broke=1,
                dissipated=0.5 * k, dissipated_strain_controlled=0.6 * k, stored=0.7 * k, stored_in_springs=0.1 * k,
                work=1.2 * k,
                fracture_energy=0.4 * k, dissipation_ratio=1.25, debonded_share=0.005 * k)
        for k in range(101)
    ]  # fmt: skip
    document = changed(path=points, kkt_tolerance=1e-6)
    del document["effective_stiffness"], document["moduli"], document["bounds"]
    document["case"]["analysis"]["type"] = "path"
    document["case"] |= {"path": {"strain": [0.0, -0.2, 1e-3], "method": "events"}, "interface": {"contact": True}}
    document["checks"] |= {"kkt_tension": 9e-7, "kkt_penetration": 2e-6}
    document["solver"] |= {"iterations": [*range(5, 30)], "factorizations": 3, "coarse_factorizations": 30}
    text = summary(document)
    assert max(map(len, text.splitlines())) < 80
    assert "101 events, 15 shown; 101 bonds broke" in text
    assert line(text, "Dissipated").endswith("per area (GPa): 50 along all equilibria, 60 if the strain only rises")
    assert line(text, "Work") == "Work per area (GPa): 120"
    assert line(text, "Stored").endswith("per area (GPa): 70, including 10 in springs")
    assert line(text, "Fracture energy") == "Fracture energy per area (GPa): 40; dissipated / fracture energy: 1.2500"
    assert line(text, "Debonded") == "Debonded: 50.0 % of the interfaces"
    first = "S22 (GPa) at the end of the path, no peak yet: -350 at E22 = -0.2 (event 100);"
    assert line(text, "S22 (GPa) at") == first
    points[100] |= {"mesh_error": 1e-4}
    words = " ".join(summary(document).split())
    assert "; mesh error of the energy 1.0e-04 at the largest stress" in words
    rows = [words.split() for words in text.splitlines() if words[:5].strip().isdigit()]
    assert len(rows) == 15
    assert rows[0] == ["0", "0", "0", "0", "-2", "0.000000", "100", "9", "1"]
    assert rows[-1] == ["100", "-0.2", "0", "-350", "-2", "1.000000", "0", "9", "1"]
    assert line(text, "Iterations").endswith("5 to 29 a state, 425 for 25 states")
    assert line(text, "Factorized").split(maxsplit=1)[1] == "3 matrices of subdomains, coarse problem 30 times"
    assert line(text, "kkt_tension").endswith("pass") and line(text, "kkt_penetration").endswith("FAIL")
    assert "at most 1.0e-07; of contact 1.0e-06" in text


ENERGIES = {
    "dissipated": 1.0,
    "dissipated_strain_controlled": 2.0,
    "stored": 3.0,
    "stored_in_springs": 0.0,
    "work": 4.0,
}


def test_a_path_in_space_tells_what_is_named_or_there_in_100_columns() -> None:
    strain, stress = [-0.01, 0.05, -0.001, 1e-9, 0.02, 1e-10], [1e-13, 60.0, 0.0, 0.0, 25.0, 1e-14]
    points = [
        counted(9 - k, load_factor=0.5 * k, strain=[k * e for e in strain], stress=[k * s for s in stress], broke=1,
                temperature=-100.0, debonded_share=0.1) | ENERGIES
        for k in (1, 2)
    ]  # fmt: skip
    document = changed(path=points)
    document["case"]["analysis"] = {"type": "path", "plane": "generalized"}
    document["case"]["path"] = {"waypoints": [{"temperature": -100.0}, {"S22": 120.0, "S13": 50.0}], "method": "events"}
    text = summary(document)
    assert max(map(len, text.splitlines())) <= 100
    head = ["event", "E22", "S22", "S13", "temperature", "E11", "load", "bonded", "open", "closed"]
    assert line(text, "event").split() == head
    assert line(text, "1 ").split()[1:6] == ["0.1", "120", "50", "-100", "-0.02"]
    assert "Also in path.csv: E33, gamma13" in text and "if the load only rises" in text


def test_the_state_under_a_load_is_reported() -> None:
    point = counted(9, strain=[-0.01, 0.05, -0.001, 1e-12, 0.02, 0.0], stress=[0.0, 60.0, 0.0, 0.0, 25.0, 1e-12])
    point |= {
        "debonded_share": 0.125,
        "free_motions": 2,
        "temperature": -100.0,
        "tips": tips_of(("strain", 3.0, 1, 60.0)),
    }
    document = changed(load=point | ENERGIES)
    del document["effective_stiffness"], document["moduli"], document["bounds"]
    document["case"]["analysis"] = {"type": "load", "plane": "generalized"}
    document["case"]["load"] = {"to": {"S22": 60.0, "S13": 25.0, "gamma12": 0.0, "temperature": -100.0}}
    text = summary(document)
    assert max(map(len, text.splitlines())) <= 100 and text.startswith(
        "pair: equilibrium under a load, generalized plane"
    )
    assert "Equilibrium under S22 = 60, S13 = 25, gamma12 = 0, temperature = -100" in text
    assert line(text, "stress").split() == ["stress", "(GPa)", "0", "60", "0", "0", "25", "0"]
    assert line(text, "Stored") == "Stored per area (GPa): 3" and line(text, "Debonded").endswith(
        "12.5 % of the interfaces"
    )
    assert "9 bonded, 9 open, 1 closed interface nodes" in text and "Free motions of fibres: 2" in text
    assert "Largest energy release rate at tips on circles (GPa mm)" in text


def test_bounds_are_those_of_bonded_cells_only() -> None:
    names, numbers = ("effective_stiffness", "effective_stiffness_compression"), ([0.25, 0.5, 0.0], [0.75, 1e-3, 2.0])
    errors = {name: [row] * 3 for name, row in zip(names, numbers, strict=True)}
    document = changed(effective_stiffness_compression=[[150.0, 57, 0], [57, 150, 0], [0, 0, 46]], mesh_error=errors)
    document["case"]["interface"] = {"contact": True, "debonded": [{"fibre": "all", "centre": 0.0, "angle": 60.0}]}
    text = summary(document)
    assert "Under minus E (GPa)" in text and "Bounds" not in text and "moduli" not in text
    rows = [row.split()[1:] for row in text.splitlines() if row.startswith("  S11")]
    assert rows[1::2] == [["2.5e-01", "5.0e-01", "0.0e+00"], ["7.5e-01", "1.0e-03", "2.0e+00"]] and len(rows) == 4


def tips_of(*tips: tuple[Any, ...]) -> dict[str, Any]:
    """Tips of a third opening: load, G, fibre and direction of each."""
    load, G, fibre, angle = (list(column) for column in zip(*tips, strict=True)) if tips else ([], [], [], [])
    thirds = {"G_I": [g / 3 for g in G], "G_II": [2 * g / 3 for g in G], "psi": [54.7356] * len(G)}
    return {"load": load, "G": G, "fibre": fibre, "angle": angle, "length": [1e-3] * len(G)} | thirds


def bonding(**top: Any) -> dict[str, Any]:
    document = changed(**top)
    document["case"]["interface"] = {"contact": True}
    return document


def test_the_largest_energy_release_rate_of_each_load_is_reported() -> None:
    tips = [("E11", 3.0, 1, 60.0), ("E11", 6.0, 12, -60.0), ("-E11", 0.0, 1, 60.0), ("-E11", 1e-12, 2, 60.0)]
    text = summary(bonding(tips=tips_of(*tips)))
    assert "Largest energy release rate at tips on circles (GPa mm)" in text
    assert line(text, "E11 ").split() == ["E11", "6", "2", "4", "54.7", "12", "-60"]
    assert line(text, "-E11").split()[-2:] == ["2", "60"] and max(map(len, text.splitlines())) < 80
    assert "energy release" not in summary(bonding(tips=tips_of())) and "energy release" not in summary(bonding())


def test_rates_along_the_fibres_have_a_column() -> None:
    tips = tips_of(("E33", 3.0, 1, 60.0), ("gamma13", 6.0, 12, -60.0)) | {"G_III": [0.0, 5.5]}
    text = summary(bonding(tips=tips))
    assert line(text, "gamma13 ").split() == ["gamma13", "6", "2", "4", "5.5", "54.7", "12", "-60"]
    assert max(map(len, text.splitlines())) <= 100


def test_energy_release_rates_against_the_angle() -> None:
    states = {"bonded": 5, "open": 3, "closed": 1, "iterations": 4}
    stiff = {"stiffness": DOCUMENT["effective_stiffness"]} | states
    tips = tips_of(("E11", 3.0, 1, 60.0), ("E22", 6.0, 1, 60.0))
    points = [{"angle": 0.0, "tips": tips_of()} | stiff, {"angle": 60.0, "tips": tips} | stiff]
    lines = summary(bonding(angle=points)).splitlines()
    where = lines.index("Largest energy release rate at tips on circles (GPa mm) under each load")
    assert [text.split() for text in lines[where + 1 : where + 4]] == [["angle", "E11", "E22"], ["60", "3", "6"], []]
    given = [
        {"angle": 60.0, "stress": [1.0, 0.0, 0.0], "tips": tips_of(("strain", 3.0, 1, 60.0), ("strain", 5.0, 2, 60.0))}
        | states
    ]
    lines = summary(bonding(angle=given)).splitlines()
    assert "C33: shear" not in "".join(lines)
    where = lines.index("Largest energy release rate at tips on circles (GPa mm)")
    assert lines[where + 2].split() == ["60", "5", "1.6667", "3.3333", "54.7", "2", "60"]


def test_states_without_iterations_are_reported() -> None:
    document = changed()
    for counts, words in (([0] * 30, "none in 30 states"), ([0], "none in 1 state")):
        document["solver"] |= {"iterations": counts}
        assert line(summary(document), "Iterations").endswith(words)
