"""Case files, right and faulty."""

import dataclasses
import json
import pickle
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from support.base_case import BASE, FIBRE, ORTHOTROPIC, OUT_OF_PLANE, SPATIAL, changed, fibre
from support.cases import make_case
from unit.case.faulty_bonding import BARE_ARC, FAULTY_BONDINGS, FAULTY_COHESIVE_LAWS, PATH, debonded, of_type
from unit.case.faulty_cases import FAULTY_CASES, FAULTY_SIZES, FAULTY_TABLE_CELLS
from unit.case.faulty_envelopes import FAULTY_ENVELOPES
from unit.case.faulty_loads import FAULTY_LOADS
from unit.case.valid_cases import MESH, VALID_CASES

from feti_homog.case.cases import check_phases, load, parse
from feti_homog.case.interface_section import Arc, InterfaceSection
from feti_homog.case.load_sections import Angle, LoadPath
from feti_homog.errors import CaseError
from feti_homog.materials.material_forms import Isotropic

FAULTY = FAULTY_CASES | FAULTY_BONDINGS | FAULTY_ENVELOPES | FAULTY_LOADS | FAULTY_SIZES | FAULTY_TABLE_CELLS
FAULTY |= FAULTY_COHESIVE_LAWS


def case_of(tmp_path: Path, content: str, name: str = "cell.toml"):
    (tmp_path / "cell.msh").touch()
    path = tmp_path / name
    path.write_text(content, encoding="utf-8")
    return load(path)


def test_keys_that_are_left_out_have_their_defaults(tmp_path):
    case = case_of(tmp_path, BASE.replace("mesh_size = 0.05\n", ""))
    assert case.name == "cell"
    assert dataclasses.asdict(case.cell) == {
        "geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.05, "interface_size": None, "tip_size": None,
        "accuracy": None, "boundary": "periodic",
        "refine": 0, "order": 1, "bodies": "torus", "fibres": None, "width": None, "fibre_radius": None,
        "coating": None, "min_gap": 0.05, "seed": 0, "radius_spread": 0.0, "file": None,
        "phases": None, "columns": None, "repair": "none", "snap_tolerance": 1e-3,
        "height": None, "fibre_list": None, "window": "periodic", "labels": None,
        "pixel": 1.0, "smooth": False, "table": None, "match": None, "matched": None,
        "voids": None, "void_radius": None,
        "mix": None, "radii": None,
    }  # fmt: skip
    assert list(case.materials.items()) == [("matrix", Isotropic(88.0, 0.299)), ("fibre", Isotropic(200.0, 0.222))]
    assert (case.analysis.type, case.analysis.plane) == ("stiffness", "strain")
    assert (case.decomposition.subdomains, case.decomposition.max_dofs) == (None, None)
    assert (case.output.fields, case.output.pictures, case.output.stress) == (True, True, "auto")
    assert (case.interface, case.angle, case.path) == (None, None, None)
    assert case.petsc == {}
    assert case.warnings() == ()


# A mistyped key that is required is also missing; a mesh has neither fraction nor size of elements, but a file.
RELATED = {
    "[material.fibre] yuong": 2, "[cell] fibre_fraction = 0.4: belongs": 3, "[material.fibre] E = 200.0": 3,
    "unknown key; did you mean normal_strength or": 4, "[path] waypoints[0].S11 = true": 6,
}  # fmt: skip


@pytest.mark.parametrize("expected", FAULTY)
def test_faults_are_reported_by_section_and_key(tmp_path, expected):
    """Each fault is one line; RELATED has the count where a key causes more faults than `expected`."""
    with pytest.raises(CaseError) as caught:
        case_of(tmp_path, FAULTY[expected])
    faults, lines = caught.value.faults, expected.splitlines()
    assert all(any(words in fault for fault in faults) for words in lines), faults
    assert all(len(fault.splitlines()) == 1 for fault in faults)
    assert caught.value.exit_code == 2
    related = [count for begin, count in RELATED.items() if expected.startswith(begin)]
    assert len(faults) == max(related, default=len(lines)), faults


def test_there_are_enough_faulty_cases():
    parts = (FAULTY_CASES, FAULTY_BONDINGS, FAULTY_ENVELOPES, FAULTY_LOADS, FAULTY_SIZES, FAULTY_TABLE_CELLS)
    assert len(FAULTY) == sum(map(len, (*parts, FAULTY_COHESIVE_LAWS))) >= 100


def test_files_that_cannot_be_read_are_reported(tmp_path):
    with pytest.raises(CaseError, match=r"none\.toml: cannot be read: No such file"):
        load(tmp_path / "none.toml")
    with pytest.raises(CaseError, match="cannot be read: Is a directory"):
        load(tmp_path)
    path = tmp_path / "cell.toml"
    path.write_bytes(BASE.encode() + "# Zelle für Stoß\n".encode("latin-1"))
    with pytest.raises(CaseError, match=r"not UTF-8 text \(line 17\)"):
        load(path)


def test_byte_order_marks_and_integers_are_allowed(tmp_path):
    assert case_of(tmp_path, "\ufeff" + BASE) == case_of(tmp_path, BASE)
    material = case_of(tmp_path, BASE.replace("88.0", "88")).materials["matrix"]
    assert isinstance(material, Isotropic)
    assert isinstance(material.young, float)
    case_of(tmp_path, changed(("0.299", "0.5"), ('"strain"', '"stress"')))


@pytest.mark.parametrize("name", VALID_CASES)
def test_resolved_makes_the_same_case_again(tmp_path, name):
    case = case_of(tmp_path, VALID_CASES[name])
    written = json.loads(json.dumps(case.resolved(), allow_nan=False))
    assert written == case.resolved()
    assert parse(written, Path("/nowhere")) == case
    assert pickle.loads(pickle.dumps(case)) == case


def test_sections_of_bonds_and_loads_are_read(tmp_path):
    case = case_of(tmp_path, debonded('{fibre = "all", centre = -30, angle = 60}, {fibre = 2, angle = 10.5}'))
    arcs = (Arc(fibre="all", centre=-30.0, angle=60.0), Arc(fibre=(2,), centre=0.0, angle=10.5))
    assert case.interface == InterfaceSection(debonded=arcs)
    assert (case.interface.contact, case.interface.criterion) == (True, "max")
    assert (case.interface.normal_strength, case.interface.tangential_strength) == (None, None)
    strong = case_of(tmp_path, of_type("path", PATH, "[interface]", "normal_strength = inf", "tangential_strength = 2"))
    assert (strong.interface.normal_strength, strong.interface.tangential_strength) == (None, 2.0)
    case = case_of(tmp_path, of_type("angle", "[angle]", "values = [0, 30, 360.0]", BARE_ARC))
    assert case.angle == Angle(values=(0.0, 30.0, 360.0), strain=None)
    assert case.interface == InterfaceSection(debonded=(Arc(fibre=(1,), angle=None),))
    case = case_of(tmp_path, of_type("path", PATH))
    assert case.path == LoadPath(strain=(0.2, 0.0, 0.0))
    assert tuple(case.path.placed.values()) == ((0.2, 0.0, 0.0),)
    assert (case.path.method, case.path.increments, case.path.max_events) == ("events", None, 100_000)
    there_and_back = case_of(tmp_path, of_type("path", "[path]\nwaypoints = [[1, 0, 0], [0, 0, 0]]"))
    assert tuple(there_and_back.path.placed.values()) == ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_replaced_values_make_the_case_of_the_edited_file(tmp_path):
    case, edited = case_of(tmp_path, BASE), changed(("200.0", "80.0"), ("mesh_size = 0.05", "accuracy = 1e-3"))
    other = case.replace({"material.fibre.young": np.float64(80.0), "cell": {"mesh_size": None, "accuracy": 1e-3}})
    assert other == case_of(tmp_path, edited) != case == case_of(tmp_path, BASE)
    back = other.replace({"material": {"fibre": {"young": 200.0}}, "cell.accuracy": None, "cell.mesh_size": 0.05})
    assert (
        back == case == case.replace({}) and pickle.loads(pickle.dumps(back)).replace({"cell.accuracy": None}) == case
    )
    # A default is not given: the order follows the new ratio as in a file.
    assert case.replace({"material.matrix.poisson": 0.499}).cell.order == 2
    (tmp_path / "cases").mkdir()
    below = case_of(tmp_path, MESH.replace("cell.msh", "../cell.msh"), "cases/one.toml")
    assert below.cell.file == (tmp_path / "cell.msh").resolve()
    assert below.replace({"output.fields": False}).cell.file == (tmp_path / "cell.msh").resolve()


@pytest.mark.parametrize(
    ("key", "value", "fault"),
    [
        ("material.fibre.young", -1.0, "[material.fibre] young = -1.0: expected a number above 0"),
        ("material.fibre.yuong", 1.0, "[material.fibre] yuong = 1.0: unknown key; did you mean young?"),
        ("material.fibre.young", None, "[material.fibre] young: missing; expected a number above 0"),
        ("materials.fibre.young", 1.0, "[materials]: unknown section; did you mean material?"),
        ("cell.mesh_size.fine", 1.0, 'cell.mesh_size.fine: "mesh_size" is not a section'),
    ],
)
def test_faults_of_replaced_values_are_those_of_files(tmp_path, key, value, fault):
    with pytest.raises(CaseError) as caught:
        case_of(tmp_path, BASE).replace({key: value})
    assert caught.value.faults == (fault,)


def test_entries_of_lists_are_replaced_by_number(tmp_path):
    case = case_of(tmp_path, fibre(ORTHOTROPIC + OUT_OF_PLANE + "expansion = [1e-6, 2e-6, 3e-6]\n"))
    assert case.replace({"material.fibre.expansion.2": 5e-6}).materials["fibre"].expansion == (1e-6, 5e-6, 3e-6)
    for key in ("expansion.4", "expansion.x1"):
        with pytest.raises(CaseError, match=f"^material.fibre.{key}: expected material.fibre.expansion.1 to material"):
            case.replace({f"material.fibre.{key}": 5e-6})
    given = case_of(tmp_path, fibre(SPATIAL))
    rows = np.array(given.materials["fibre"].stiffness)
    rows[0, 1] = rows[1, 0] = 3.5
    found = given.replace({"material.fibre.stiffness.C12": 3.5}).materials["fibre"].stiffness
    np.testing.assert_array_equal(found, rows)


def test_phases_of_mesh_and_case_must_match(tmp_path):
    case = case_of(tmp_path, MESH)
    check_phases(case, ["matrix", "fibre"])
    check_phases(case, ["matrix", "fibre:1", "fibre:2"])
    assert case.material_of("fibre:2") == Isotropic(200.0, 0.222)
    with pytest.raises(CaseError, match=r"^\[material.fibre\]: the mesh has no such phase; it has matrix$"):
        check_phases(case, ["matrix"])
    with pytest.raises(CaseError, match=r'^\[material."fibre:2"\]: missing section; the mesh has this phase$'):
        check_phases(case_of(tmp_path, MESH.replace(FIBRE, "")), ["matrix", "fibre:2"])
    own = case_of(tmp_path, MESH + '[material."fibre:2"]\nyoung = 1\npoisson = 0\n')
    assert own.material_of("fibre:2") == Isotropic(1.0, 0.0)
    with pytest.raises(CaseError, match="fibre:2"):
        check_phases(own, ["matrix", "fibre"])
    with pytest.raises(CaseError) as caught:
        check_phases(case, ["matrix", "surface2"])
    missing, hint = caught.value.faults
    assert missing == "[material.surface2]: missing section; the mesh has this phase"
    assert hint.endswith('If they are the same, add to [cell]: phases = {fibre = "surface2"}')
    other = case_of(tmp_path, MESH.replace("material.matrix", "material.resin"))  # a mesh may lack the matrix, too
    with pytest.raises(CaseError) as caught:
        check_phases(other, ["matrix", "fibre"])
    assert caught.value.faults[1].endswith("it has matrix, fibre. If it is matrix, rename the section")
    mapped = case_of(
        tmp_path, MESH.replace('"cell.msh"', '"cell.msh"\nphases = {fibre = 2}').replace(".fibre]", ".glass]")
    )
    with pytest.raises(CaseError, match=r"it has matrix, fibre. If it is fibre, rename the section$"):
        check_phases(mapped, ["matrix", "fibre"])


@pytest.mark.parametrize("plane", ["strain", "stress", "generalized"])
def test_high_contrast_is_warned_of(tmp_path, plane):
    case = BASE.replace('"strain"', f'"{plane}"').replace("young = 200.0", "young = 1e13")
    (warning,) = case_of(tmp_path, case).warnings()
    assert warning.startswith("[material.fibre], [material.matrix]: stiffnesses differ by ")
    assert case_of(tmp_path, case.replace("1e13", "1e11")).warnings() == ()


def test_keys_of_friction_without_friction_are_warned_of():
    numbers = {"stiffness": 10.0, "strength": 1.0, "toughness": 1.0}
    interface = {f"{side}_{name}": value for side in ("normal", "tangential") for name, value in numbers.items()}
    interface |= {"law": "bilinear", "friction": 0.0, "friction_on_damage": True}
    asked = make_case(plane="generalized").replace({"analysis.type": "path", "path": {"waypoints": [{"E11": 0.01}]}})
    (words,) = asked.replace({"interface": interface}).warnings()
    assert words == "[interface] friction_on_damage = true: without effect, for friction = 0"
    assert asked.replace({"interface": interface | {"friction": 0.3}}).warnings() == ()


@pytest.mark.parametrize("sizes", ["", "accuracy = 0.1\n"])
def test_elements_of_nearly_incompressible_phases_are_quadratic(tmp_path, sizes):
    sized = BASE if not sizes else BASE.replace("mesh_size = 0.05\n", sizes)
    locking = sized.replace("0.299", "0.4999")
    case, sheet = (case_of(tmp_path, text) for text in (locking, locking.replace('"strain"', '"stress"')))
    (remark,) = case.remarks()
    assert remark.startswith("[material.matrix] poisson = 0.4999: elements are quadratic")
    assert case.cell.order == 2 and case.warnings() == ()
    assert sheet.cell.order == 1 and sheet.remarks() == sheet.warnings() == ()
    with pytest.raises(CaseError, match=r"^\[cell\] order = 1: .*lock: \[material.matrix\] poisson = 0.4999; expected"):
        case_of(tmp_path, locking.replace("[cell]\n", "[cell]\norder = 1\n"))
    (warning,) = case_of(tmp_path, sized.replace("0.299", "0.499999999")).warnings()
    assert "so near to 0.5 that rounding may exceed the tolerance" in warning
    for ratio, is_faulty in (("0.499999", False), ("0.4999995", True)):
        differentiated = sized.replace("0.299", ratio) + "[output]\nsensitivities = true\n"
        with pytest.raises(CaseError, match=r"need at most 0.499999$") if is_faulty else nullcontext():
            case_of(tmp_path, differentiated)


def test_phases_of_any_name(tmp_path):
    named = MESH.replace("material.fibre", "material.E-glass_1") + '[material."carbon:2"]\nyoung = 5\npoisson = 0\n'
    case = case_of(tmp_path, named)
    check_phases(case, ["matrix", "E-glass_1", "carbon:2"])
    assert case.material_of("E-glass_1") == Isotropic(200.0, 0.222)
    with pytest.raises(CaseError, match=r"^\[material.boron\]: missing section; the mesh has this phase$"):
        check_phases(case, ["matrix", "E-glass_1", "carbon:2", "boron"])
    for name in ("void", '"my glass"', '"glass:"'):
        with pytest.raises(CaseError, match="unknown phase"):
            case_of(tmp_path, MESH + f"[material.{name}]\nyoung = 5\npoisson = 0\n")


def test_scatter_of_a_case_names_the_command_that_takes_it(tmp_path):
    text = changed(("fibre_fraction = 0.4", "fibre_fraction = {mean = 0.4, cv = 0.1}"))
    with pytest.raises(CaseError, match="a number above 0 and below 1; `feti-homog uncertainty` takes scatter"):
        case_of(tmp_path, text)
