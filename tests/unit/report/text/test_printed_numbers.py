"""Numbers of printed tables against those that follow from the stiffness, the points of a path and the phases alone."""

import re
from functools import cache

import numpy as np
import pytest
from support.cases import case_of

from feti_homog import run
from feti_homog.report.text.summary import summary

NUMBER = re.compile(r"(?<![\w.+-])-?\d+\.?\d*(?:e[+-]?\d+)?(?![\w.])")
MATRIX, FIBRE = {"young": 3.0, "poisson": 0.35, "expansion": 6e-5}, {"young": 70.0, "poisson": 0.2, "expansion": 5e-6}


@cache
def result(plane, kind="stiffness"):
    """Return the raw numbers of a small cell, and its printed blocks."""
    cell = {"geometry": "random", "fibres": 2, "fibre_fraction": 0.3, "mesh_size": 0.3, "seed": 2}
    sections = {"material": {"matrix": MATRIX, "fibre": FIBRE}, "output": {"sensitivities": True}}
    if kind == "path":
        bonds = {"normal_stiffness": 40.0, "tangential_stiffness": 20.0, "normal_strength": 0.05}
        sections |= {"interface": bonds, "path": {"waypoints": [{"E11": 0.05}, {"E11": 0.0}]}, "output": {}}
    raw = run(case_of(cell, plane=plane, **sections)).document
    return raw, [block.splitlines() for block in summary(raw).split("\n\n")]


def block(blocks, start):
    """Return the numbers of the rows of the block whose title begins so."""
    lines = next(lines for lines in blocks if lines[0].startswith(start))
    return [[float(each) for each in NUMBER.findall(line)] for line in lines[1:]]


def without_errors(blocks, start):
    """Return the numbers of a block that are no errors of the mesh."""
    lines = next(lines for lines in blocks if lines[0].startswith(start))
    kept = [re.sub(r"\+- *\S+", "", line) for line in lines[1:]]
    return [float(each) for line in kept for each in NUMBER.findall(line)]


def plane_stiffness(own):
    """C11 and C12 = lambda, and mu of a phase in plane strain."""
    E, nu = own["young"], own["poisson"]
    la, mu = E * nu / (1 + nu) / (1 - 2 * nu), E / 2 / (1 + nu)
    return np.array([[la + 2 * mu, la, 0.0], [la, la + 2 * mu, 0.0], [0.0, 0.0, mu]])


def test_stiffness_moduli_and_bounds_in_the_plane():
    raw, blocks = result("strain")
    C = np.array(raw["effective_stiffness"])
    np.testing.assert_allclose(block(blocks, "Effective stiffness")[:3], C, atol=1e-6 * C.max())
    S = np.linalg.inv(C)
    k, mu = (C[0, 0] + C[1, 1] + 2 * C[0, 1]) / 4, (C[0, 0] + C[1, 1] - 2 * C[0, 1] + 4 * C[2, 2]) / 8
    moduli = [1 / S[0, 0], -S[0, 1] / S[0, 0], 1 / S[1, 1], -S[0, 1] / S[1, 1], 1 / S[2, 2], S[0, 2] / S[0, 0]]
    found = without_errors(blocks, "Engineering moduli")
    np.testing.assert_allclose(found[:6], moduli, rtol=2e-2, atol=2e-3)
    np.testing.assert_allclose([found[6], found[8]], [k, mu], rtol=2e-2)
    c, phases = raw["cell"]["fractions"], {"matrix": plane_stiffness(MATRIX), "fibre": plane_stiffness(FIBRE)}
    voigt = sum(c[name] * own for name, own in phases.items())
    reuss = np.linalg.inv(sum(c[name] * np.linalg.inv(own) for name, own in phases.items()))
    rows = block(blocks, "Bounds")
    for i in range(3):
        np.testing.assert_allclose(rows[i][-3:], [reuss[i, i], C[i, i], voigt[i, i]], rtol=1e-5)
    bulk, shear = ({name: f(own) for name, own in phases.items()} for f in
                   (lambda own: (own[0, 0] + own[0, 1]) / 2, lambda own: own[2, 2]))  # fmt: skip
    for around, column in (("matrix", -3), ("fibre", -1)):
        k0, mu0 = bulk[around], shear[around]
        h0 = k0 * mu0 / (k0 + 2 * mu0)
        expected = [
            1 / sum(c[name] / (own[name] + more) for name in phases) - more for own, more in ((bulk, mu0), (shear, h0))
        ]
        np.testing.assert_allclose([rows[3][column], rows[4][column]], expected, rtol=1e-5)


def test_elasticities_are_homogeneous_in_the_moduli_of_phases():
    """Of degree one in both moduli together: the rows of Young's moduli add to 1 for stresses, to 0 for ratios."""
    _, blocks = result("strain")
    young = np.array([row for row in block(blocks, "Elasticities") if row][:4])
    names = [line.split()[0] for line in next(b for b in blocks if b[0].startswith("Elasticities"))[2:6]]
    e = {name.split(".")[1]: own for name, own in zip(names, young, strict=True) if name.endswith("young")}
    np.testing.assert_allclose(e["matrix"] + e["fibre"], [1, 1, 1, 1, 1, 1, 0, 1], atol=2e-4)


def test_constants_in_space():
    """Material axes 1, 2, 3 are x3, x1, x2 of the cell; what holds for axes of the cell and about the fibres."""
    raw, blocks = result("generalized")
    C = np.array(raw["effective_stiffness"])
    S = np.linalg.inv(C)
    alpha = -S @ raw["thermal_stress"]
    E, G = 1 / S.diagonal()[:3], 1 / S.diagonal()[3:]  # G23, G13, G12 of the cell
    material = [E[2], E[0], E[1], G[1], G[0], G[2], -S[2, 0] * E[2], -S[2, 1] * E[2], -S[0, 1] * E[0]]
    np.testing.assert_allclose(without_errors(blocks, "Material axes"), material, rtol=2e-2)
    ratios = [-S[0, 1] * E[0], -S[0, 2] * E[0], -S[1, 2] * E[1]]
    np.testing.assert_allclose(without_errors(blocks, "Engineering constants"), [*E, *G[::-1], *ratios], rtol=2e-2)
    angle = np.linspace(0.0, np.pi, 2000)
    n = np.array([np.cos(angle) ** 2, np.sin(angle) ** 2, np.sin(angle) * np.cos(angle)])
    t = np.array([-np.sin(2 * angle), np.sin(2 * angle), np.cos(2 * angle)])
    plane = S[np.ix_([0, 1, 5], [0, 1, 5])]
    across = [1 / np.einsum("ik,ij,jk->k", x, plane, x) for x in (n, t)]
    lines = next(lines for lines in blocks if lines[0].startswith("Along the fibres"))
    ends = [float(each) for each in re.findall(r"(?:from|to) (\S+?),?(?= |$)", " ".join(lines[1].split()))]
    assert ends == pytest.approx([across[0].min(), across[0].max(), across[1].min(), across[1].max()], rel=1e-4)
    k, m = (C[0, 0] + C[1, 1] + 2 * C[0, 1]) / 4, (C[0, 0] + C[1, 1] - 2 * C[0, 1] + 4 * C[5, 5]) / 8
    across_along, p = (C[0, 2] + C[1, 2]) / 2, (C[3, 3] + C[4, 4]) / 2
    E_a, nu_a = C[2, 2] - across_along**2 / k, across_along / 2 / k
    E_t = 4 / (1 / m + 1 / k + 4 * nu_a**2 / E_a)
    own = [float(x) for line in lines if "this cell" in line for x in NUMBER.findall(line)]
    expected = [E_a, E_t, nu_a, E_t / 2 / m - 1, p, m, k, alpha[2], (alpha[0] + alpha[1]) / 2]
    np.testing.assert_allclose(own, expected, rtol=1e-4)
    thermal = np.array([row[-4::2] if len(row) > 4 else row[-2:] for row in block(blocks, "Per unit of temp")[1:]])
    np.testing.assert_allclose(thermal[:, 0], raw["thermal_stress"], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(thermal[:, 1], alpha, rtol=1e-5, atol=1e-10)


def test_totals_and_rows_of_a_path():
    """Work under rays through zero, to which a break falls at its strain, less what the last leg gives back."""
    raw, blocks = result("strain", "path")
    points = raw["path"]
    lines = next(lines for lines in blocks if lines[0].startswith("Path"))
    *pulled, end = points
    e, s = (np.array([point[name][0] for point in pulled]) for name in ("strain", "stress"))  # the others are free
    work = 0.5 * (s / e * (e**2 - np.r_[0.0, e[:-1]] ** 2)).sum() - 0.5 * s[-1] * e[-1]
    assert end["strain"][0] == 0.0 and all(point["broke"] for point in pulled[:-1])
    assert not any("fracture_energy" in point for point in points)  # strengths alone know no toughness

    def number(start):
        return float(NUMBER.findall(next(line for line in lines if line.startswith(start)).partition(": ")[2])[0])

    assert number("Work per area") == pytest.approx(work, rel=2e-3)
    assert number("Dissipated per area") == pytest.approx(work - number("Stored per area"), rel=2e-3)
    rows = [[float(x) for x in NUMBER.findall(line)] for line in lines if re.match(r" *\d+ ", line)]
    assert len(rows) > 5
    for row in rows:
        point = points[int(row[0])]
        assert row[1] == pytest.approx(point["strain"][0], rel=1e-4, abs=1e-9)
        assert row[2] == pytest.approx(point["stress"][0], rel=1e-4, abs=1e-9)
        assert row[-3:] == [point["bonded"], point["open"], point["closed"]]
    found = [float(x) for x in NUMBER.findall(" ".join(lines[1:3]).partition(": ")[2])]
    assert found[:3] == pytest.approx([s[0], e[0], 0.0], rel=1e-5)  # before the fall to point 12
    assert found[5:8] == pytest.approx([s[0], e[0], 0.0], rel=1e-5)  # behind fibre and angle
