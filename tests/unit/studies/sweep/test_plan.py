"""Cases of a table [sweep], and the lines about faulty tables."""

import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.sweep_files import CASE, RANDOM

from feti_homog.errors import CaseError
from feti_homog.studies import sweep_cases


def expanded(table: str, case: str = CASE):
    return sweep_cases.expand({"name": "s"} | tomllib.loads(f"{case}[sweep]\n{table}"), Path())


def inputs(table: str, case: str = CASE):
    return [entry.inputs for entry in expanded(table, case).entries]


def values(table: str, name: str = "cell.fibre_fraction"):
    return [found[name] for found in inputs(table)]


def test_grid_in_the_order_of_the_file_the_last_fastest():
    found = inputs("cell.fibre_fraction = [0.1, 0.2]\nmaterial.fibre.young = [100, 200, 300]")
    assert [tuple(row.values()) for row in found] == [(c, E) for c in (0.1, 0.2) for E in (100, 200, 300)]


def test_values_arrive_in_the_cases():
    sweep = expanded("cell.fibre_fraction = [0.1, 0.2]\n'material.fibre.young' = [100, 300]\nmode = 'zip'")
    assert [(c.cell.fibre_fraction, c.materials["fibre"].young) for c in sweep.cases] == [(0.1, 100.0), (0.2, 300.0)]
    assert [case.name for case in sweep.cases] == ["s-0001", "s-0002"]
    assert [entry.folder for entry in sweep.entries] == ["case-0001", "case-0002"]
    assert len({entry.identity for entry in sweep.entries}) == 2


def test_a_table_replaces_the_value_of_a_key_but_is_merged_into_a_section():
    case = f"{CASE}[load]\nto = {{S11 = 1.0}}\n".replace('"stiffness"', '"load"')
    found = expanded("load.to = [{S22 = 2.0}, {S12 = 3.0}]\ncell = [{fibre_fraction = 0.2}]\n", case).cases
    assert [one.single_load.to.named for one in found] == [{"S22": 2.0}, {"S12": 3.0}]
    assert [(one.cell.geometry, one.cell.fibre_fraction) for one in found] == [("hexagonal", 0.2)] * 2
    assert found[0].replace({"load.to": {"E22": 1.0}}).single_load.to.named == {"E22": 1.0}


def test_loads_by_name_are_varied_as_any_keys():
    case = CASE.replace('"stiffness"', '"load"')
    table = "load.to.S11 = {from = 10, to = 30, step = 10}\n'load.to.E22' = [0.0, 0.1]\n"
    sweep = expanded(f"{table}mode = 'grid'\n", case)
    assert [(full["S11"], full["E22"]) for case in sweep.cases for full in case.targets] == [
        (S11, E22) for S11 in (10.0, 20.0, 30.0) for E22 in (0.0, 0.1)
    ]
    assert [entry.inputs["load.to.S11"] for entry in sweep.entries] == [10, 10, 20, 20, 30, 30]
    path = expanded("path.to = [{S11 = 60.0}, {S12 = 1.0}]", CASE.replace('"stiffness"', '"path"'))
    assert [case.path.to.named for case in path.cases] == [{"S11": 60.0}, {"S12": 1.0}]
    waypoints = "path.waypoints = [[{S11 = 1.0}], [{S11 = 1.0}, [0.0, 0.0, 0.0]]]"
    assert [len(case.targets) for case in expanded(waypoints, CASE.replace('"stiffness"', '"path"')).cases] == [1, 2]


@pytest.mark.parametrize(
    ("range_", "expected"),
    [
        ("{from = 0.1, to = 0.3, step = 0.1}", [0.1, 0.2, 0.3]),
        ("{from = 0.1, to = 0.35, step = 0.1}", [0.1, 0.2, 0.3]),
        ("{from = 0.2, to = 0.6, step = 0.4}", [0.2, 0.6]),  # 0.6 - 0.2 is less than 0.4 by rounding
        ("{from = 0.1, to = 0.3, count = 5}", [0.1, 0.15, 0.2, 0.25, 0.3]),
        ("{from = 0.01, to = 0.16, count = 3, scale = 'log'}", [0.01, 0.04, 0.16]),
    ],
)
def test_ranges_end_at_their_last_step(range_, expected):
    assert values(f"cell.fibre_fraction = {range_}") == expected


def test_integers_stay_integers():
    found = inputs("cell.fibres = {from = 2, to = 32, count = 5, scale = 'log'}", RANDOM)
    assert [row["cell.fibres"] for row in found] == [2, 4, 8, 16, 32]
    found = inputs("samples = 40\ncell.fibres = {from = 2, to = 9}", RANDOM)
    assert all(isinstance(row["cell.fibres"], int) for row in found)


@pytest.mark.parametrize("sampling", ["latin", "random"])
def test_samples_fill_their_ranges_and_repeat_with_the_seed(sampling):
    table = f"samples = 50\nsampling = '{sampling}'\ncell.fibre_fraction = {{from = 0.1, to = 0.6}}\n"
    table += "material.fibre.young = {from = 1.0, to = 1000.0, scale = 'log'}"
    found = inputs(table)
    assert found == inputs(table) != inputs(f"{table}\nseed = 1")
    fractions = np.array([row["cell.fibre_fraction"] for row in found])
    decades = np.log10([row["material.fibre.young"] for row in found])
    assert fractions.min() >= 0.1 and fractions.max() <= 0.6 and decades.min() >= 0.0 and decades.max() <= 3.0
    # A Latin hypercube has one sample in each of 50 equal parts.
    strata = len(set(np.floor((fractions - 0.1) / 0.01 * (1 - 1e-9))))
    assert strata == 50 if sampling == "latin" else strata < 50
    assert np.mean(decades) == pytest.approx(1.5, abs=0.4)


def test_samples_differ_and_are_repeated_at_every_point_of_a_grid():
    found = inputs("samples = 3\ncell.order = [1, 2]\ncell.fibre_fraction = {from = 0.1, to = 0.6}")
    assert [row["cell.order"] for row in found] == [1, 1, 1, 2, 2, 2]
    assert [row["cell.fibre_fraction"] for row in found[:3]] == [row["cell.fibre_fraction"] for row in found[3:]]
    found = values("samples = 20\ncell.fibre_fraction = {from = 0.1, to = 0.6}")
    assert all(a != b for a, b in pairwise(sorted(found)))


def test_realisations_are_seeds_and_come_last():
    case = RANDOM.replace("fibres = 3", "fibres = 3\nseed = 7")
    sweep = expanded("realisations = 3\ncell.fibre_fraction = [0.2, 0.3]", case)
    assert [(e.point, e.realisation, e.inputs["cell.seed"]) for e in sweep.entries] == [
        (1, 1, 7), (2, 1, 7), (1, 2, 8), (2, 2, 8), (1, 3, 9), (2, 3, 9),
    ]  # fmt: skip
    assert [case.cell.seed for case in sweep.cases] == [7, 7, 8, 8, 9, 9]
    fewer = expanded("realisations = 2\ncell.fibre_fraction = [0.2, 0.3]", case)
    assert sweep.entries[:4] == fewer.entries


def test_strengths_that_scatter_are_realised_too():
    """In random and in other cells, of one interface and of several; lists of seeds give realisations of one point."""
    bonds = "[interface]\nnormal_strength = 1.0\nscatter = {shape = 5.0, seed = 4}\n"
    square, random = (f"{text.replace('stiffness', 'path')}[path]\nto.E11 = 0.1\n" for text in (CASE, RANDOM))
    for case, cells in ((square, [0, 0]), (random, [0, 1])):
        sweep = expanded("realisations = 2", case + bonds)
        assert [(e.point, e.realisation) for e in sweep.entries] == [(1, 1), (1, 2)]
        assert [case.cell.seed for case in sweep.cases] == cells
        assert [case.interfaces[0].scatter.seed for case in sweep.cases] == [4, 5]
    sweep = expanded('mode = "zip"\ncell.seed = [0, 1]\ninterface.scatter.seed = [7, 9]', random + bonds)
    assert [(e.point, e.realisation) for e in sweep.entries] == [(1, 1), (1, 2)]
    both = bonds.replace("[interface]\n", '[[interface]]\nbetween = ["matrix", "fibre"]\n')
    sweep = expanded("realisations = 2", square + both)
    assert [case.interfaces[0].scatter.seed for case in sweep.cases] == [4, 5]
    with pytest.raises(CaseError, match=r"excludes interface\.scatter\.seed"):
        expanded("realisations = 2\ninterface.scatter.seed = [1, 2]", square + bonds)


def test_seeds_in_a_list_are_realisations_of_one_point():
    sweep = expanded("cell.seed = [4, 9]\ncell.fibre_fraction = [0.2, 0.3]", RANDOM)
    found = [(e.point, e.realisation, e.inputs["cell.fibre_fraction"], e.inputs["cell.seed"]) for e in sweep.entries]
    assert found == [(1, 1, 0.2, 4), (2, 1, 0.3, 4), (1, 2, 0.2, 9), (2, 2, 0.3, 9)]


def test_sections_vary_as_tables_and_only_random_cells_have_realisations():
    case = CASE.replace('geometry = "hexagonal"\n', "")
    table = "realisations = 2\ncell = [{geometry = 'square'}, {geometry = 'random', fibres = 3}]"
    sweep = expanded(f"{table}\n'cell.fibre_fraction' = [0.2, 0.3]", case)
    assert [(e.point, e.inputs["cell.geometry"], e.realisation) for e in sweep.entries] == [
        (1, "square", 1), (2, "square", 1), (3, "random", 1), (4, "random", 1), (3, "random", 2), (4, "random", 2),
    ]  # fmt: skip
    assert [case.cell.fibre_fraction for case in sweep.cases] == [0.2, 0.3] * 3


def test_strains_and_arcs_vary_too():
    case = CASE.replace('"stiffness"', '"path"') + "[interface]\n[path]\n"
    table = "path.strain = [[0.1, 0.0, 0.0], [0.0, 0.0, 0.1]]\ninterface.debonded = [[], [{fibre = 1, angle = 30.0}]]"
    sweep = expanded(table, case)
    assert [len(case.arcs) for case in sweep.cases] == [0, 1, 0, 1]
    assert [case.path.strain[2] for case in sweep.cases] == [0.0, 0.0, 0.1, 0.1]


FAULTY = {
    "nothing varies": ("", ["nothing varies"]),
    "scalar": ("cell.order = 2", ["[sweep] cell.order = 2: expected a list of values"]),
    "no values": ("cell.order = []", ["expected at least one value"]),
    "unknown setting": ("realisation = 3", ["[sweep] realisation = 3: unknown key; did you mean realisations?"]),
    "no section": (
        "fibre_fraction = [0.2]",
        ['[sweep] fibre_fraction = [0.2]: unknown key; did you mean "cell.fibre_fraction"?'],
    ),
    "unknown section": ("cel.order = [1]", ["unknown key; did you mean cell?"]),
    "name": ("name = ['a']", ["[sweep] name"]),
    "backwards": ("cell.fibre_fraction = {from = 0.3, to = 0.1, step = 0.1}", ["expected numbers from < to"]),
    "both": ("cell.fibre_fraction = {from = 0.1, to = 0.3, step = 0.1, count = 3}", ["step, count: exclude"]),
    "neither": ("cell.fibre_fraction = {from = 0.1, to = 0.3}", ["with step, with count, or with samples"]),
    "no step": ("cell.fibre_fraction = {from = 0.1, to = 0.3, step = 0.0}", ["expected a step above 0"]),
    "one of a count": ("cell.fibre_fraction = {from = 0.1, to = 0.3, count = 1}", ["expected a count from 2"]),
    "log of zero": ("cell.fibre_fraction = {from = 0, to = 0.3, count = 3, scale = 'log'}", ["above 0"]),
    "range's key": ("cell.fibre_fraction = {from = 0.1, to = 0.3, by = 0.1}", ["by: unknown key"]),
    "nothing sampled": ("samples = 3\ncell.order = [1]", ["no key is to be sampled"]),
    "zip": ("mode = 'zip'\ncell.order = [1]\ncell.refine = [0, 1]", ["1 of cell.order, 2 of cell.refine"]),
    "mode": ("mode = 'rows'\ncell.order = [1]", ["[sweep] mode"]),
    "twice": ("cell.order = [1]\n'cell.order' = [2]", ["[sweep] cell.order: given twice"]),
    "twice by table": ("cell = [{order = 2}]\n'cell.order' = [1]", ["[sweep] cell.order: given twice"]),
    "regular realisations": ("realisations = 2\ncell.order = [1]", ["only random cells and strengths that scatter"]),
    "too many": ("samples = 10000\ncell.order = [1, 2]\ncell.fibre_fraction = {from = 0.1, to = 0.2}", ["20000"]),
    "two units": ("output.stress_unit = ['GPa', 'MPa']", ["[output] stress_unit: expected the same in all cases"]),
    "a case's fault": (
        "cell.fibre_fraction = [0.4, 0.95, 0.99]",
        ["case-0002: [cell] fibre_fraction = 0.95", "case-0003: [cell] fibre_fraction = 0.99"],
    ),
    "every case's fault": (
        "cell.ordr = [1, 2, 3, 4, 5, 6]",
        ["case-0001: [cell] ordr = 1: unknown key", "case-0006: [cell] ordr = 6"],
    ),
    "one fault of many": (
        "cell.orders = [1]\ncell.refine = [0, 1, 2, 3, 4, 5]",
        ["case-0001, case-0002, case-0003, case-0004 and 2 more: [cell] orders = 1: unknown key"],
    ),
}


@pytest.mark.parametrize("name", FAULTY)
def test_faults_of_a_sweep_are_reported(name):
    table, expected = FAULTY[name]
    with pytest.raises(CaseError) as caught:
        expanded(table)
    assert all(any(words in fault for fault in caught.value.faults) for words in expected), caught.value.faults


def test_realisations_of_faulty_values_are_no_second_fault():
    with pytest.raises(CaseError) as caught:
        expanded("realisations = 2\ncell.fibre_fraction = {from = 0.1, to = 0.3}", RANDOM)
    (fault,) = caught.value.faults
    assert fault.startswith("[sweep] cell.fibre_fraction = ")


def test_sweeps_that_contradict_their_case_are_refused(tmp_path):
    with pytest.raises(CaseError, match=r"excludes cell\.seed"):
        expanded("realisations = 2\ncell.seed = [1, 2]", RANDOM)
    path = tmp_path / "case.toml"
    path.write_text(CASE)
    with pytest.raises(CaseError, match="feti-homog run"):
        sweep_cases.load(path)
    with pytest.raises(CaseError, match=r"cell\.order: \"cell\" is not a section"):
        sweep_cases.expand({"cell": 3, "sweep": {"cell.order": [1]}}, Path())


def test_values_may_be_numpys():
    base = tomllib.loads(CASE)
    sweep = sweep_cases.expand(base | {"sweep": {"cell.fibre_fraction": np.linspace(0.1, 0.3, 3)}}, Path())
    same = sweep_cases.expand(base | {"sweep": {"cell": {"fibre_fraction": np.linspace(0.1, 0.3, 3).tolist()}}}, Path())
    assert sweep == same and len(sweep.cases) == 3
    assert all(type(entry.inputs["cell.fibre_fraction"]) is float for entry in sweep.entries)


def test_options_that_print_make_no_other_sweep():
    options = "", "feti_ksp_monitor = true", 'feti_pc_type = "lumped"'
    known, looked, other = (expanded("cell.order = [1, 2]", f"{CASE}[petsc]\n{option}\n").entries for option in options)
    assert known == looked and all(a.identity != b.identity for a, b in zip(known, other, strict=True))
