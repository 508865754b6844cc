"""Cards read back by readers of their own: the material of the result, turned to the axes of a card."""

import csv
import io

import numpy as np
import pytest
from support.card_readers import CONSTANTS, READERS, stiffness_of_constants
from support.effective_results import (
    BORON_ALUMINIUM,
    COSINES,
    DISTINCT,
    GLASS_EPOXY,
    PAIRS,
    TURNED,
    TURNED_WITHOUT_EXPANSION,
    document,
    turned_stiffness,
)

from feti_homog.commands.parser import command_parser
from feti_homog.errors import CaseError
from feti_homog.materials.engineering_constants import engineering_constants
from feti_homog.report.cards import effective_material
from feti_homog.report.cards.effective_material import in_axes_of_the_cell, nearest_transversely_isotropic
from feti_homog.report.cards.export import FORMATS
from feti_homog.report.text import constant_tables
from feti_homog.system.runtime.records import plain

every_format = pytest.mark.parametrize("form", FORMATS)


def compliance(C):
    """(6, 6) of a tensor."""
    return np.linalg.inv(np.array([[C[*row, *column] for column in PAIRS] for row in PAIRS]))


def assert_same(found, expected):
    """Cards have nine digits."""
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((found - expected) / size).max() < 1e-8


def assert_is_the_material(text, form, sample):
    C, alpha = READERS[form](text)
    assert_same(compliance(C), np.linalg.inv(turned_stiffness(sample.stiffness_in_the_cell, COSINES.T)))
    if sample.expansion is None:
        assert alpha is None
    else:
        to_card = COSINES.T @ sample.cosines
        expected = to_card @ np.diag(sample.expansion) @ to_card.T
        assert np.abs(alpha - expected).max() < 1e-8 * np.abs(expected).max()


@every_format
@pytest.mark.parametrize(
    "sample",
    [BORON_ALUMINIUM, GLASS_EPOXY, DISTINCT, TURNED_WITHOUT_EXPANSION, TURNED],
    ids=["boron", "glass", "distinct", "turned without expansion", "turned"],
)
def test_material_is_read_back_orthotropic_or_not(form, sample):
    if form != "ansys" or sample is not TURNED:  # whose shears of the expansion Ansys has not
        assert_is_the_material(FORMATS[form](in_axes_of_the_cell(document(sample))), form, sample)


@pytest.mark.parametrize(("form", "kind"), [("abaqus", "engineering"), ("calculix", "the tensor's")])
def test_comments_name_the_kind_of_shears(form, kind):
    text = FORMATS[form](in_axes_of_the_cell(document(TURNED)))
    comment = f"** alpha11, alpha22, alpha33, alpha12, alpha13, alpha23; {kind} shears"
    assert comment == text.splitlines()[text.splitlines().index("*EXPANSION, TYPE=ANISO") + 1]


def test_shears_of_the_expansion_are_refused_by_ansys_which_has_none():
    with pytest.raises(CaseError, match=r"expansion has shears in its axes, .* use --transversely-isotropic"):
        FORMATS["ansys"](in_axes_of_the_cell(document(TURNED)))


@every_format
def test_transversely_isotropic_material_is_that_of_its_constants(form):
    assert_is_the_material(FORMATS[form](nearest_transversely_isotropic(document(TURNED))), form, GLASS_EPOXY)


def test_constants_stand_where_the_fibre_is_axis_1():
    """E1 and nu12 of the literature, not E3 and nu31 of the cell."""
    constants = in_axes_of_the_cell(document(DISTINCT)).constants
    assert list(constants) == CONSTANTS.split()
    assert list(constants.values()) == pytest.approx(DISTINCT.constants, rel=1e-13)


def test_table_has_the_constants_of_its_stiffness():
    rows = list(csv.DictReader(io.StringIO(FORMATS["csv"](in_axes_of_the_cell(document(DISTINCT))))))
    values = {row["name"]: float(row["value"]) for row in rows}
    C, _ = READERS["csv"](FORMATS["csv"](in_axes_of_the_cell(document(DISTINCT))))
    assert_same(compliance(C), compliance(stiffness_of_constants(values)))
    units = {row["name"]: row["unit"] for row in rows}
    assert (units["E1"], units["nu12"], units["C44"], units["expansion_axial"]) == ("GPa", "", "GPa", "1 / temperature")
    assert all(row["meaning"] for row in rows)


@pytest.mark.parametrize(("form", "mark"), [("abaqus", "**"), ("calculix", "**"), ("ansys", "!"), ("moose", "#")])
def test_comments_say_what_the_axes_and_units_are(form, mark):
    name = "fibres in \u00e9poxy, 55 %, " + "very " * 60
    text = FORMATS[form](
        in_axes_of_the_cell(
            document(DISTINCT)
            | {"case": document(DISTINCT)["case"] | {"name": name}, "remarks": ["[cell] boundary: a bound", "other"]}
        )
    )
    comments = " ".join(line.removeprefix(mark).strip() for line in text.splitlines() if line.startswith(mark))
    assert text.isascii() and max(map(len, text.splitlines())) < 256 and "\\xe9poxy" in comments
    for words in ("Axis 1 is the fibre, x3 of the cell", "axes 2 and 3 are x1 and x2", "Stresses in GPa", "per unit of",
                  "nu_ij = -eps_j/eps_i", "Orthotropic; ", "left out. [cell] boundary: a bound."):  # fmt: skip
        assert words in comments


EXPANSIONS = ("expansion_x1", "expansion_x2", "expansion_axial")
AXES_IN_THE_CELL = {1: 3, 2: 1, 3: 2}  # the fibre is axis 1 of a card, and x3 of the cell
ABOUT_THE_FIBRE = {
    "E1": "E_axial", "E2": "E_transverse", "E3": "E_transverse", "nu12": "nu_axial", "nu13": "nu_axial",
    "nu23": "nu_transverse", "G12": "G_axial", "G13": "G_axial", "G23": "G_transverse",
    "expansion_axial": "expansion_axial", "expansion_transverse": "expansion_transverse",
}  # fmt: skip


def in_the_cell(name):
    """Return the constant of the cell that a card calls so: by its axes, of shears in rising order."""
    letters, axes = name.rstrip("123"), [AXES_IN_THE_CELL[int(digit)] for digit in name if digit.isdigit()]
    return letters + "".join(map(str, sorted(axes) if letters == "G" else axes))


def listed(text, words):
    """Return the numbers by name of the comment of a card with these words."""
    comment = " ".join(text.replace("**", " ").replace("!", " ").replace("#", " ").split())
    part = comment.partition(f"{words}: ")[2].partition(". ")[0].removesuffix(".")
    return {name: float(number) for name, number in (each.split() for each in part.split(", "))}


@pytest.mark.parametrize("form", ["abaqus", "ansys", "moose"])
def test_comments_have_the_errors_of_the_mesh_in_the_axes_of_the_card(form):
    """Every constant of a card has the error of its own, all unlike, and no other constant's."""
    cell = {f"{k}{i}{j}": 0.0 for k in ("nu", "G") for i in (1, 2, 3) for j in (1, 2, 3)}
    names = [*CONSTANTS.split(), *EXPANSIONS]
    errors = {name: round(0.011 * (k + 1), 3) for k, name in enumerate(names)}
    found = {"constants": cell | {in_the_cell(name): errors[name] for name in CONSTANTS.split()}}
    found["thermal_expansion"] = [*(errors[name] for name in EXPANSIONS), 0.5, 0.5, 0.5]
    printed = listed(FORMATS[form](in_axes_of_the_cell(document(DISTINCT, mesh_error=found))), "by the mesh")
    assert printed == pytest.approx(errors, rel=0.05)
    known = {own: 0.011 * (k + 1) for k, own in enumerate(dict.fromkeys(ABOUT_THE_FIBRE.values()))}
    text = FORMATS[form](nearest_transversely_isotropic(document(DISTINCT, mesh_error={"constants": known})))
    expected = {name: known[own] for name, own in ABOUT_THE_FIBRE.items()}
    assert listed(text, "by the mesh") == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(
    ("value", "text"),
    [(215.33468712345678, "215.334687"), (-1.0993681512345678e-05, "-1.09936815e-05"), (-1.23456789e-300, None),
     (123456789012345678.0, "1.23456789e+17"), (0.1, "0.1"), (-0.0, "0"), (128e3, "128000")],
)  # fmt: skip
def test_numbers_have_nine_digits(value, text):
    number = effective_material.number(value)
    assert text in (None, number) and len(number) <= 20
    assert float(number) == pytest.approx(value, rel=5e-9, abs=0.0)


@pytest.mark.parametrize(
    ("name", "identifier"),
    [("E-glass/epoxy 55 %", "E_glass_epoxy_55"), ("55 %", "material_55"), ("\u2126", "material"), ("a" * 99, "a" * 60)],
)
def test_names_are_those_that_programs_accept(name, identifier):
    assert effective_material.identifier(name) == identifier


def test_the_command_line_offers_every_format():
    arguments = command_parser().parse_args(["export", "DIR", "--format", "csv"])
    assert arguments.symmetry == "orthotropic" and arguments.out is None
    (words,) = [a.help for a in _export_actions() if a.dest == "format"]
    assert words.endswith(f": {', '.join(FORMATS)}")


def _export_actions():
    commands = next(a.choices for a in command_parser()._actions if isinstance(a.choices, dict))
    return commands["export"]._actions


def test_the_printed_material_axes_are_those_of_cards():
    """Constants of distinct values, with the fibre along axis 1, from those in the axes of the cell."""
    cell = plain(engineering_constants(DISTINCT.stiffness_in_the_cell))
    printed = constant_tables.constants({"constants": cell})
    names = ("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13", "G23")
    assert [printed[name] for name in names] == pytest.approx(DISTINCT.constants, rel=1e-12)
