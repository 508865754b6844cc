"""Faulty fit files: a line each, with its section and key."""

import tomllib
from pathlib import Path

import pytest
from support.base_case import BASE

from feti_homog.case.cases import Case
from feti_homog.errors import CaseError
from feti_homog.studies import uncertainty
from feti_homog.studies.fit_file import parse

UNKNOWN = "[unknown]\nmaterial.fibre.young = {start = 150.0, lower = 50.0, upper = 500.0}\n"
MEASURED = "[measured]\nC11 = {value = 150.0, std = 1.5}\n"
PATH = (
    '[interface]\ncriterion = "energy"\nnormal_stiffness = 100.0\ntangential_stiffness = 50.0\ntoughness = 0.01\n'
    "[path]\nstrain = [0.1, 0.0, 0.0]\n"
)


def faults(text: str, folder: Path = Path()) -> tuple[str, ...]:
    with pytest.raises(CaseError) as error:
        parse(tomllib.loads(text), folder)
    return error.value.faults


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (MEASURED, "[unknown]: expected a table of SECTION.KEY = {start, lower, upper}"),
        (f"[unknown]\nmaterial.fibre.young = 3.0\n{MEASURED}",
         "[unknown] material.fibre.young = 3.0: expected a table {start, lower, upper}"),
        (f"[unknown]\nmaterial.fibre.young = {{start = 1.0, lower = 0.5}}\n{MEASURED}",
         "[unknown] material.fibre.young.upper: missing; expected a number"),
        (UNKNOWN.replace("150.0", "600.0") + MEASURED,
         "[unknown] material.fibre.young: lower = 50, start = 600, upper = 500: expected lower <= start <= upper, "
         "lower < upper"),
        (UNKNOWN.replace("50.0, upper", "-50.0, upper") + MEASURED,
         "[unknown] material.fibre.young, lower = -50.0: case-0001: [material.fibre] young = -50.0: expected a number "
         "above 0"),
        (UNKNOWN.replace("young", "yuong") + MEASURED,
         "case-0001: [material.fibre] yuong = 150.0: unknown key; did you mean young?"),
        (f"[unknown]\npetsc.feti_ksp_rtol = {{start = 1e-9, lower = 1e-10, upper = 1e-8}}\n{MEASURED}",
         "[unknown] petsc.feti_ksp_rtol: no measured value depends on it"),
        (UNKNOWN, "expected [measured] for one test or [[test]] for each of several, with measured"),
        (f"{UNKNOWN}[measured]\nC11 = 3.0\n", "[measured] C11 = 3.0: expected a table {value, std}"),
        (f"{UNKNOWN}[measured]\nC11 = {{value = 3.0, std = 0.0}}\n",
         "[measured] C11.std = 0.0: expected a number above 0"),
        (f"{UNKNOWN}[measured]\nC11 = {{value = -3.0, std = 1e-100}}\n",
         "[measured] C11.std = 1e-100: expected at least 1e-12 of -3"),
        (f"{UNKNOWN}[measured]\nE_axial = {{value = 3.0, std = 0.1}}\n",
         "[measured] E_axial: the analysis does not give it; expected one of C11, C12, C13, C22, C23, C33, E1, E2, "
         "nu12, nu21, G12"),
        (f'{UNKNOWN}[measured]\ncurve = {{file = "none.csv", std = 0.1}}\n',
         '[measured] curve.file = "none.csv": No such file or directory'),
        (UNKNOWN + 'material.matrix.young = {start = 1.0, lower = 0.5, upper = 2.0}\n' + MEASURED,
         "[unknown]: 2 unknowns, 1 measured value; expected at least as many values"),
        (f"{UNKNOWN}[[test]]\nmaterial.fibre.young = 3.0\n[test.measured]\nC11 = {{value = 3.0, std = 0.1}}\n",
         "[[test]] 1, material.fibre.young: it is an unknown of [unknown]"),
        (f"{UNKNOWN}[[test]]\ncell.fibre_fraction = 0.3\n",
         "[[test]] 1, [measured]: expected a table of NAME = {value, std}"),
        (f"{UNKNOWN}{MEASURED}[sweep]\nrealisations = 2\n",
         "[sweep]: a fit has no sweep; expected [[test]] for each test"),
    ],
)  # fmt: skip
def test_faults_have_their_line(text, line):
    assert faults(BASE + text) == (line,)


def test_few_values_hide_no_misspelt_name():
    text = (
        f"{UNKNOWN}material.matrix.young = {{start = 1.0, lower = 0.5, upper = 2.0}}\n{MEASURED.replace('C11', 'C44')}"
    )
    count, name = faults(BASE + text)
    assert "2 unknowns, 1 measured value;" in count and name.startswith("[measured] C44: the analysis does not give it")


def test_a_case_file_with_unknowns_is_none_of_a_run():
    with pytest.raises(CaseError, match=r"\[unknown\]: unknown section; it belongs to the file of a fit"):
        Case.parse(tomllib.loads(BASE + UNKNOWN))


def test_tests_are_changes_of_one_case(tmp_path):
    table = "[[test]]\ncell.fibre_fraction = {}\n[test.measured]\nC11 = {{value = 3.0, std = 0.1}}\n"
    fit = parse(tomllib.loads(BASE + UNKNOWN + table.format(0.3) + table.format(0.5)), tmp_path)
    cases = fit.at([77.0]).cases
    assert [case.cell.fibre_fraction for case in cases] == [0.3, 0.5]
    assert all(case.materials["fibre"].young == 77.0 and case.output.sensitivities for case in cases)


def test_the_load_of_a_test_replaces_the_load_of_the_case():
    case = f"{BASE.replace('stiffness', 'path')}{PATH.replace('strain = [0.1, 0.0, 0.0]', 'to = {S11 = 1.0}')}"
    test = "[[test]]\npath.to = {S22 = 2.0}\n[test.measured]\npeak_S22 = {value = 1.0, std = 0.1}\n"
    (load,) = parse(tomllib.loads(case + UNKNOWN + test), Path()).at([77.0]).cases[0].targets
    assert {name: value for name, value in load.items() if value} == {"S22": 2.0}


@pytest.mark.parametrize(
    ("load", "table", "line"),
    [
        ("strain = [0.1, 0.0, 0.0]", "E11, S33\n0.01, 1.0\n", '[measured] curve: plane = "strain" has no S33'),
        ("strain = [0.1, 0.0, 0.0]", f"E11, S11\n{'1' * 200_000}, 1.0\n", "...: expected a number"),
        ("strain = [0.1, 0.0, 0.0]", "E11,S11\n0,01,0,03\n", ", line 2: expected 2 columns, one for each name; it"),
        ("strain = [0.1, 0.0, 0.0]", "E11,S11\n\n0.01\n", ", line 3: expected 2 columns, one for each name; it has 1"),
        ("strain = [0.1, 0.0, 0.0]", "E11,S11\n0.01,0_3.0\n", ', line 2: S11 = "0_3.0": expected a number'),
        ("strain = [0.1, 0.0, 0.0]", "E11,S11\n0.01,nan\n", ', line 2: S11 = "nan": expected a number'),
        ("strain = [0.1, 0.0, 0.0]", "E11,S11\n0.01,\n", ', line 2: S11 = "": expected a number'),
        ("strain = [0.1, 0.0, 0.0]", 'E11,S11\n"0,01","3"\n', ", line 2: expected 2 columns, one for each"),
        ("strain = [0.1, 0.0, 0.0]", "E11,E22,S11\n0.01,1,3\n", ': "E11,E22,S11": expected names of one strain and'),
        ("strain = [0.1, 0.0, 0.0]", "E11 (%),S11\n1,3\n", ': "E11 (%),S11": expected names of one strain and'),
        ("strain = [0.1, 0.0, 0.0]", "", ': "": expected names of one strain and one stress: E11,S11'),
        ("strain = [0.1, -0.2, 0.0]", "E11, S11\n0.01, 1.0\n",
         "[measured] curve: expected the strain that rises along the path, E22"),
        ("strain = [0.1, 0.0, 0.0]", "E11, S11\n0.0, 0.0\n-0.01, 1.0\n",
         "[measured] curve: expected strains of the sign of the path, which ends at 0.1"),
        ("strain = [-0.1, 0.0, 0.0]", "E11, S11\n-0.01, 1.0\n-0.0999, 2.0\n-0.1, 2.0\n-0.08, 1.5\n0.0, 0.0\n",
         "[measured] curve: expected strains that rise, without unloading from 0.1 to 0"),
        ("to = {E11 = 0.1}", "E11, S22\n0.01, 1.0\n", "[measured] curve: S22 is prescribed as 0"),
        ("strain = [-0.1, 0.0, 0.0]", "E11, S11\n-0.01, 1.0\n-0.11, 2.0\n",
         "[measured] curve: a strain of 0.11 is beyond the end of the path at 0.1"),
        ("strain = [0.1, 0.0, 0.0]", "E11, S11\n10.0, 1.0\n",
         "[measured] curve: a strain of 10 is beyond the end of the path at 0.1; in per cent?"),
        ("strain = [0.1, 0.0, 0.0]", "E11, S11\n0.2, 1.0\n0.6, 3.0\n",
         "[measured] curve: a strain of 0.6 is beyond the end of the path at 0.1; in per cent?"),
        ("waypoints = [{S11 = -1.0, S22 = 0.0, S12 = 0.0}]", "E11, S11\n0.01, 1.0\n",
         "[measured] curve: expected strains of the sign of the path, which ends at -1"),
        ("waypoints = [{S11 = 1.0}, {S11 = 0.0}]", "E11, S11\n0.01, 1.0\n",
         "[measured] curve: expected an analysis of type path, of one leg"),
        (None, "E11, S11\n0.01, 1.0\n", "[measured] curve: expected an analysis of type path, of one leg"),
    ],
)  # fmt: skip
def test_curves_have_their_faults(tmp_path, load, table, line):
    """All of them before anything is computed."""
    (tmp_path / "curve.csv").write_text(table)
    unknown, end = UNKNOWN, '[measured]\ncurve = {file = "curve.csv", std = 0.1}\n'
    if load is not None:
        end += PATH.partition("[path]")[0] + f"[path]\n{load}\n"
    text = (BASE if load is None else BASE.replace('"stiffness"', '"path"')) + unknown + end
    found = faults(text, tmp_path)
    assert len(found) == 1 and line in found[0], found


def test_curves_may_have_decimal_commas_between_semicolons(tmp_path):
    (tmp_path / "curve.csv").write_text("sep=;\nE11;time;S11\n0,01;2;3,5 # first\n")
    end = '[measured]\ncurve = {file = "curve.csv", std = 0.1}\n' + PATH.partition("[path]")[0]
    text = BASE.replace('"stiffness"', '"path"') + UNKNOWN + end + "[path]\nstrain = [0.1, 0.0, 0.0]\n"
    (point,) = parse(tomllib.loads(text), tmp_path).data
    assert (point.strain_name, point.strain, point.name, point.value) == ("E11", 0.01, "S11", 3.5)


def test_expansions_can_be_measured_where_all_phases_have_them(tmp_path):
    document = tomllib.loads(BASE.replace('"strain"', '"generalized"') + UNKNOWN)
    document |= {"measured": {"expansion_x1": {"value": 2e-5, "std": 1e-6}}}
    with pytest.raises(CaseError, match="expansion_x1: the analysis does not give it"):
        parse(document, tmp_path)
    for material in document["material"].values():
        material["expansion"] = 1e-5
    (datum,) = parse(document, tmp_path).data
    assert datum.name == "expansion_x1"


def test_a_fit_whose_output_asks_for_more_is_another():
    """So is a study of scatter."""
    text = BASE + UNKNOWN + MEASURED
    fits = [parse(tomllib.loads(f"{text}[output]\nmesh_error = {words}\n"), Path()) for words in ("true", "false")]
    assert fits[0].digest() != fits[1].digest()
    text = BASE.replace("young = 88.0", "young = {mean = 88.0, cv = 0.1}")
    studies = [
        uncertainty.parse(tomllib.loads(f"{text}[output]\n{words}\n"), Path()) for words in ("", "mesh_error = false")
    ]
    assert studies[0].digest() != studies[1].digest()


def spatial_fit(names: str) -> str:
    measured = "".join(f'"{name}" = {{value = 3.0, std = 0.1}}\n' for name in names.split())
    return BASE.replace('"strain"', '"generalized"') + UNKNOWN + f"[measured]\n{measured}"


def test_constants_of_a_data_sheet_are_read_in_the_axes_of_the_cell():
    """E2 is across the fibres in both; names with axial and transverse need no words."""
    fit = parse(tomllib.loads(spatial_fit("E1 E2 G12 E_axial nu12")), Path())
    assert fit.axes() == (
        "[measured] E1 is Young's modulus across the fibres; along them E_axial. "
        "G12 is shear across the fibres; along them G_axial. "
        "nu12 is contraction under stress across the fibres; along them nu_axial"
    )
    assert parse(tomllib.loads(spatial_fit("E_axial G_transverse")), Path()).axes() == ""
    assert parse(tomllib.loads(BASE + UNKNOWN + MEASURED.replace("C11", "E1")), Path()).axes() == ""


def test_former_names_have_the_names_in_their_place():
    assert faults(spatial_fit("expansion.3 thermal_stress.1 alpha2")) == (
        '[measured] "expansion.3": its name is expansion_axial',
        '[measured] "thermal_stress.1": its name is thermal_S11',
        "[measured] alpha2: its name is expansion_x1",
    )
