"""Cards in CalculiX: a cube of one element, under six unit stresses and warmer, has the constants of the result."""

import os
import shutil
import subprocess

import numpy as np
import pytest
from support.effective_results import BORON_ALUMINIUM, COSINES, DISTINCT, TURNED, document, turned_stiffness
from support.jobs import PATIENCE

from feti_homog.report.cards.effective_material import in_axes_of_the_cell
from feti_homog.report.cards.export import calculix

pytestmark = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed (Debian: calculix-ccx)")

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # the order in which CalculiX prints
HOTTER = 100.0
DIGITS = 1e-6  # of the seven that CalculiX prints


def deck(card):
    """Return the cube on supports without reactions.

    Steps of unit stresses in the order of PAIRS, then of temperature.
    """
    nodes = "\n".join(f"{k}, {x}., {y}., {z}." for k, (x, y, z) in enumerate(CORNERS, start=1))
    steps = [f"*CLOAD, OP=NEW\n{forces(pair)}\n*TEMPERATURE, OP=NEW\nALL, 0." for pair in PAIRS]
    steps += [f"*CLOAD, OP=NEW\n1, 1, 0.\n*TEMPERATURE, OP=NEW\nALL, {HOTTER}"]
    ends = [f"*STEP\n*STATIC\n{loads}\n*EL PRINT, ELSET=CUBE\nE\n*END STEP\n" for loads in steps]
    return (
        f"*NODE, NSET=ALL\n{nodes}\n*ELEMENT, TYPE=C3D8, ELSET=CUBE\n1, 1, 2, 3, 4, 5, 6, 7, 8\n{card}\n"
        f"*SOLID SECTION, ELSET=CUBE, MATERIAL={card.partition('NAME=')[2].splitlines()[0]}\n"
        "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 0.\n*BOUNDARY\n1, 1, 3\n2, 2, 3\n4, 3, 3\n" + "".join(ends)
    )


def forces(pair):
    """Nodal forces of a unit stress: a quarter of the traction of each face that a corner has."""
    stress = np.zeros((3, 3))
    stress[pair] = stress[pair[::-1]] = 1.0
    nodal = (2 * CORNERS - 1) @ stress / 4
    return "\n".join(f"{k + 1}, {i + 1}, {nodal[k, i]}" for k, i in zip(*np.nonzero(nodal), strict=True))


def strains(folder, card):
    """(7, 3, 3) strains of the steps."""
    (folder / "cube.inp").write_text(deck(card))
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    run = subprocess.run(
        ["ccx", "cube"], cwd=folder, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert run.returncode == 0 and "*ERROR" not in run.stdout and "*WARNING" not in run.stdout, run.stdout[-2000:]
    rows = [line.split() for line in (folder / "cube.dat").read_text().splitlines()]
    table = np.array([list(map(float, row[2:])) for row in rows if len(row) == 8 and row[0] == "1"])
    means = table.reshape(len(PAIRS) + 1, 8, 6).mean(axis=1)
    tensors = np.zeros((len(means), 3, 3))
    for k, (i, j) in enumerate(PAIRS):
        tensors[:, i, j] = tensors[:, j, i] = means[:, k]
    return tensors


@pytest.mark.parametrize("sample", [BORON_ALUMINIUM, DISTINCT, TURNED], ids=["boron", "distinct", "turned"])
def test_unit_stresses_and_warmth(tmp_path, sample):
    found = strains(tmp_path, calculix(in_axes_of_the_cell(document(sample))))
    S = np.linalg.inv(turned_stiffness(sample.stiffness_in_the_cell, COSINES.T))[:, [0, 1, 2, 5, 4, 3]]
    tensor = np.array([[S[0], S[5] / 2, S[4] / 2], [S[5] / 2, S[1], S[3] / 2], [S[4] / 2, S[3] / 2, S[2]]])
    assert np.abs(found[:6] - np.moveaxis(tensor, 2, 0)).max() < DIGITS * np.abs(tensor).max()
    for k, strain in enumerate(found[:6]):
        expected = tensor[..., k]
        assert np.abs(strain - expected).max() < DIGITS * np.abs(expected).max()
    to_card = COSINES.T @ sample.cosines
    expected = to_card @ np.diag(sample.expansion) @ to_card.T * HOTTER
    assert np.abs(found[6] - expected).max() < DIGITS * np.abs(expected).max()
