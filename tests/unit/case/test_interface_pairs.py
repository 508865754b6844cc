"""Several sections [[interface]]: what is read, resolved and refused."""

import re
from pathlib import Path

import pytest

from feti_homog import Case
from feti_homog.case.interface_section import InterfaceSection
from feti_homog.case.relations import COMMON
from feti_homog.errors import CaseError
from feti_homog.schema.keys import keys_of
from feti_homog.studies.sweep_cases import case_documents

OUTER, INNER = ["coating", "matrix"], ["fibre", "coating"]
STRONG = {"normal_strength": 1.0}
ENERGY = {"criterion": "energy", "normal_stiffness": 2.0, "tangential_stiffness": 1.0, "toughness": 0.1}


def document(interface, kind="path"):
    path = {"path": {"to": {"E11": 0.1}}} if kind == "path" else {}
    return {
        "cell": {"geometry": "square", "fibre_fraction": 0.4},
        "material": {name: {"young": 1.0, "poisson": 0.3} for name in ("matrix", "fibre")},
        "analysis": {"type": kind, "plane": "strain"},
        "interface": interface,
    } | path


def test_lists_of_sections_are_resolved_to_themselves():
    one, listed = (Case.parse(document(interface)) for interface in (STRONG, [STRONG]))
    assert one == listed and one.resolved()["interface"] == listed.resolved()["interface"]
    assert one.digest() == listed.digest() and "between" not in one.resolved()["interface"]
    case = Case.parse(document([STRONG | {"between": OUTER}, {"normal_strength": 3.0, "between": INNER}]))
    assert [interface.between for interface in case.interfaces] == [("coating", "matrix"), ("fibre", "coating")]
    assert [interface.normal_strength for interface in case.interfaces] == [1.0, 3.0]
    assert Case.parse(case.resolved()) == case


FAULTY = {
    "no pair": ([STRONG | {"between": OUTER}, STRONG], "[interface 2] between: missing; of several [[interface]]"),
    "the same pair": (
        [STRONG | {"between": OUTER}, STRONG | {"between": OUTER[::-1]}],
        '[interface 2] between = ["matrix", "coating"]: expected another pair than [interface 1] has',
    ),
    "a phase with itself": (STRONG | {"between": ["matrix", "matrix"]}, "[interface] between = "),
    "one phase": (STRONG | {"between": "coating"}, '[interface] between = "coating": expected the names of two phases'),
    "three phases": (STRONG | {"between": ["a", "b", "c"]}, "expected the names of two phases"),
    "laws": (
        [STRONG | {"between": OUTER}, STRONG | {"between": INNER, "law": "quadratic"}],
        '[interface 2] law = "quadratic": expected "max", as of [interface 1]',
    ),
    "a value of the second": (
        [STRONG | {"between": OUTER}, {"normal_strength": -1.0, "between": INNER}],
        "[interface 2] normal_strength = -1.0: expected",
    ),
    "an arc of the second": (
        [STRONG | {"between": OUTER}, STRONG | {"between": INNER, "debonded": [{"fibre": 0, "angle": 3.0}]}],
        "[interface 2] debonded[0].fibre = 0: ",
    ),
    "a spring that is missing": (
        [ENERGY | {"between": OUTER}, {k: v for k, v in ENERGY.items() if "tangential" not in k} | {"between": INNER}],
        "[interface 2] tangential_stiffness: missing",
    ),
    "none": ([], "interface = []: expected a section [interface]"),
    "no table": ([STRONG | {"between": OUTER}, 3], "interface 2 = 3: expected a section"),
}


@pytest.mark.parametrize("name", FAULTY)
def test_faults_name_their_section(name):
    interface, words = FAULTY[name]
    with pytest.raises(CaseError) as caught:
        Case.parse(document(interface))
    assert any(words in fault for fault in caught.value.faults), caught.value.faults


TABLE = {
    "law": "table", "tangential_stiffness": 1.0, "tangential_strength": 1.0, "tangential_toughness": 2.0,
    "openings": [0.1, 1.0], "tractions": [1.0, 0.0],
}  # fmt: skip
BILINEAR = TABLE | {"law": "bilinear", "normal_stiffness": 10.0, "normal_strength": 1.0}
del BILINEAR["openings"], BILINEAR["tractions"]
ARC = {"fibre": 1, "angle": 30.0}


@pytest.mark.parametrize(
    ("law", "method", "key"),
    [
        (BILINEAR | {"normal_toughness": 0.5}, "events", "a larger softening_tolerance"),
        (TABLE | {"teeth": 5}, "events", "fewer teeth"),
        (BILINEAR | {"normal_toughness": 0.5}, "increments", ""),
        (STRONG, "events", ""),
    ],
)
def test_a_path_of_damage_names_the_key_that_makes_it_cheaper(law, method, key):
    path = {"strain": [0.01, 0.0, 0.0], "method": method} | ({"increments": 5} if method == "increments" else {})
    advice = Case.parse(document(law) | {"path": path}).fewer_events
    assert (key in advice) and bool(advice) == bool(key)


# Of each key a law that has it, and two values.
VALUES = {
    "contact": (STRONG, True, False),
    "friction": (STRONG, 0.1, 0.2),
    "friction_on_damage": (TABLE | {"friction": 0.1}, True, False),
    "axial_friction": (STRONG | {"friction": 0.1}, "free", "prevented"),
    "debonded": (STRONG, [ARC], [ARC | {"angle": 60.0}]),
    "normal_stiffness": (STRONG, 1.0, 2.0),
    "tangential_stiffness": (STRONG, 1.0, 2.0),
    "axial_stiffness": (STRONG, 1.0, 2.0),
    "conductance": ({}, 1.0, 2.0),
    "normal_strength": ({}, 1.0, 2.0),
    "tangential_strength": ({}, 1.0, 2.0),
    "axial_strength": ({}, 1.0, 2.0),
    "law": (STRONG, "max", "quadratic"),
    "criterion": (STRONG, "max", "quadratic"),
    "normal_toughness": (BILINEAR, 0.5, 0.6),
    "tangential_toughness": (TABLE, 2.0, 3.0),
    "mixing_exponent": (TABLE, 1.0, 2.0),
    "teeth": (TABLE, 5, 6),
    "softening_tolerance": (TABLE, 0.1, 0.2),
    "openings": (TABLE, [0.1, 1.0], [0.1, 2.0]),
    "tractions": (TABLE, [1.0, 0.0], [2.0, 0.0]),
    "toughness": (ENERGY, 0.1, 0.2),
    "growth": (ENERGY, "released", "springs"),
    "mode_sensitivity": (ENERGY, 0.2, 0.3),
    "scatter": (STRONG, {"shape": 8.0}, {"shape": 8.0, "seed": 1}),
    "between": (STRONG, OUTER, INNER),
}


@pytest.mark.parametrize("name", keys_of(InterfaceSection))
def test_sections_differ_in_the_keys_of_a_pair_alone(name):
    """Two values of each key: one fault with section, key and the value of the first, or a case that has both."""
    law, *values = VALUES[name]
    sections = [
        {"between": between} | law | {name: value} for between, value in zip((OUTER, INNER), values, strict=True)
    ]
    whole = document(sections) | {"path": {"to": {"E11": 0.1}}}
    whole["analysis"]["plane"] = "generalized"
    if name == "conductance":
        phases = {phase: {"conductivity": 1.0} for phase in ("matrix", "fibre")}
        whole = document(sections, "stiffness") | {"analysis": {"type": "conductivity"}, "material": phases}
    if keys_of(InterfaceSection)[name].by_pair:
        read = Case.parse(whole).resolved()["interface"]
        assert [section[name] for section in read] != [read[0][name]] * 2
        return
    with pytest.raises(CaseError) as caught:
        Case.parse(whole)
    assert len(caught.value.faults) == 1
    assert caught.value.faults[0].startswith(f"[interface 2] {name} = ")
    assert "as of [interface 1]" in caught.value.faults[0]


def test_what_is_read_of_the_first_section_is_common_to_all():
    sources = "\n".join(path.read_text() for path in (Path(__file__).parents[3] / "feti_homog").rglob("*.py"))
    of_first = re.findall(r"(?:case\.interface|(?:bonds|interfaces)\[0\])\.(\w+)", sources)
    read = {*of_first, *re.findall(r"\.common\(\"(\w+)\"\)", sources)}
    assert read | {"law"} == {*COMMON}  # whose value is that of `criterion`


def test_sweeps_vary_a_key_of_one_section():
    base = document([STRONG | {"between": OUTER}, STRONG | {"between": INNER}])
    faults: list[str] = []
    ((_, varied),) = case_documents(base, [{("interface", "2", "normal_strength"): 5.0}], None, faults)
    assert not faults
    assert [interface["normal_strength"] for interface in varied["interface"]] == [1.0, 5.0]
    replaced = Case.parse(base).replace({"interface.2.normal_strength": 5.0})
    assert replaced == Case.parse(varied) and replaced.interfaces[0] == Case.parse(base).interfaces[0]


@pytest.mark.parametrize(
    "path, words",
    [
        (("interface", "normal_strength"), "there are 2 sections [[interface]]; expected interface.1.normal_strength"),
        (("interface", "3", "normal_strength"), '"3" is not a section'),
        (("interface", "0", "normal_strength"), '"0" is not a section'),
    ],
)
def test_sweeps_say_which_section_they_lack(path, words):
    base = document([STRONG | {"between": OUTER}, STRONG | {"between": INNER}])
    faults: list[str] = []
    case_documents(base, [{path: 5.0}], None, faults)
    assert any(words in fault for fault in faults), faults
    with pytest.raises(CaseError) as caught:
        Case.parse(base).replace({".".join(path): 5.0})
    assert [f"[sweep] {fault}" for fault in caught.value.faults] == faults
