"""Effective conductivity against axial shear, Keller's reciprocity, series, closed forms and other runs."""

import json

import numpy as np
import pytest
from reference.spatial_forms import axial_shear_modulus
from support.void_cells import write_voids

from feti_homog import run, run_fit, run_sweep
from feti_homog.analysis.runner import compute
from feti_homog.case.cases import Case
from feti_homog.verify.certificate import verify
from feti_homog.verify.findings import NO_REASON

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

MATRIX, FIBRE, POISSON = 0.2, 1.7, 0.25
RANDOM = {"geometry": "random", "fibres": 6, "fibre_fraction": 0.4, "mesh_size": 0.15, "width": 2.0}
ARC = [{"fibre": 2, "centre": 30.0, "angle": 110.0}]
BONDS = {"none": None, "springs": {"conductance": 3.0}, "arc": {"debonded": ARC, "conductance": 3.0}}
SEVERAL = {"decomposition": {"subdomains": 14}}


def document(matrix=MATRIX, fibre=FIBRE, interface=None, sections=None, **cell):
    """Return a case of conductivity as a document; `cell` are keys of its cell."""
    phases = {"matrix": matrix} | ({} if fibre is None else {"fibre": fibre})
    return (
        {
            "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.2} | cell
            if cell.get("geometry") != "mesh"
            else cell,
            "material": {name: {"conductivity": k} for name, k in phases.items()},
            "analysis": {"type": "conductivity"},
            "petsc": {"feti_ksp_rtol": 1e-12},
            "output": {"pictures": False},
        }
        | ({} if interface is None else {"interface": interface})
        | (sections or {})
    )


def solved(comm, folder=".", **case):
    """Return k^ef of a case. Collective."""
    return compute(Case.parse(document(**case), folder), comm).effective_conductivity


@pytest.mark.one_rank
@pytest.mark.parametrize(("bonds", "order"), [("none", 2), ("springs", 1), ("arc", 2)])
def test_axial_shear_with_moduli_k_is_conduction(comm, shared_interfaces, bonds, order):
    case = document(**RANDOM, seed=order, order=order, interface=BONDS[bonds], sections=SEVERAL)
    k = compute(Case.parse(case), comm).effective_conductivity
    case["analysis"] = {"type": "stiffness", "plane": "generalized"}
    case["material"] = {
        name: {"young": 2 * (1 + POISSON) * own["conductivity"], "poisson": POISSON}
        for name, own in case["material"].items()
    }
    if bonds != "none":
        case["interface"] = {"contact": False, "axial_stiffness": 3.0, "debonded": BONDS[bonds].get("debonded", [])}
    C = compute(Case.parse(case), comm).effective_stiffness
    assert k[:2, :2] == pytest.approx(C[np.ix_([4, 3], [4, 3])], rel=1e-12, abs=1e-12 * np.abs(k).max())
    assert not k[2, :2].any() and not k[:2, 2].any()


@pytest.mark.one_rank
def test_along_the_fibres_the_mean_conducts(comm):
    fibre = {"axial": 10.0, "transverse": 1.0}
    result = compute(Case.parse(document(fibre=fibre, interface=BONDS["arc"], **RANDOM)), comm)
    mean = result.cell.fractions["matrix"] * MATRIX + result.cell.fractions["fibre"] * fibre["axial"]
    assert result.effective_conductivity[2, 2] == pytest.approx(mean, rel=1e-12)


@pytest.mark.one_rank
@pytest.mark.parametrize("order", [1, 2])
def test_phases_of_one_tensor_conduct_as_they_do(comm, order):
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    tensor = (turn @ np.diag([1.0, 3.0, 20.0]) @ turn.T).tolist()
    case = {**RANDOM, "order": order, "sections": SEVERAL}
    assert solved(comm, matrix=tensor, fibre=tensor, **case) == pytest.approx(np.array(tensor), rel=1e-11)


@pytest.mark.one_rank
def test_coupling_out_of_the_plane_follows_from_a_change_of_axes(comm):
    """x3' = x3 - a x1 leaves the plane as it is: k' = A k A^T, with A' = A k^ef A^T."""
    A = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.7, 0.4, 1.0]])
    phases = [np.diag([MATRIX, MATRIX, 1.0]), np.diag([FIBRE, FIBRE, 5.0])]
    plain, sheared = (
        solved(comm, matrix=matrix.tolist(), fibre=fibre.tolist(), **RANDOM)
        for matrix, fibre in (phases, [A @ k @ A.T for k in phases])
    )
    assert sheared == pytest.approx(A @ plain @ A.T, rel=1e-10)


@pytest.mark.one_rank
@pytest.mark.parametrize(("order", "factor"), [(1, 3.0), (2, 9.0)])
def test_keller_reciprocity_in_the_limit_of_the_mesh(comm, order, factor):
    """K(k1, k2) = k1 k2 K(k2, k1) / det K(k2, k1) in the plane (Keller 1964, Mendelson 1975).

    The flux of one problem, turned by 90 degrees, is the gradient of the other. Elements have a continuous temperature,
    but no continuous normal flux, so that both conductivities are too large by the error of the mesh.
    """
    errors = []
    for refine in (0, 1, 2):
        case = {**RANDOM, "order": order, "refine": refine}
        K, swapped = (solved(comm, matrix=a, fibre=b, **case)[:2, :2] for a, b in ((1.0, 5.0), (5.0, 1.0)))
        off = K - 5.0 * swapped / np.linalg.det(swapped)
        assert np.linalg.eigvalsh(off).min() > 0.0
        errors.append(np.abs(off).max())
    assert errors[0] > factor * errors[1] > factor**2 * errors[2] and errors[0] < 0.05


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("geometry", "fraction", "contrast"), [("square", 0.5, 10.0), ("square", 0.7, 50.0), ("hexagonal", 0.7, 1e-6)]
)
def test_arrays_of_perrins_mckenzie_and_mcphedran(comm, geometry, fraction, contrast):
    case = {"geometry": geometry, "fibre_fraction": fraction, "order": 2, "mesh_size": 0.1, "refine": 2}
    k = solved(comm, matrix=1.0, fibre=contrast, **case)[:2, :2]
    expected = axial_shear_modulus(geometry, fraction, contrast)
    assert np.abs(k - expected * np.eye(2)).max() < 2e-6 * expected


@pytest.mark.one_rank
@pytest.mark.parametrize("h", [0.5, 4.0, 100.0])
def test_dilute_fibres_with_kapitza_resistance(comm, h):
    """Hasselman and Johnson, Journal of Composite Materials 21 (1987) 508, for cylinders across the flux."""
    km, kf, f = 1.0, 20.0, 0.05
    case = Case.parse(
        document(matrix=km, fibre=kf, interface={"conductance": h, "debonded": []}, fibre_fraction=f, order=2, refine=2)
    )
    result = compute(case, comm)
    x, f = kf / (h * np.sqrt(f / np.pi)), result.cell.fractions["fibre"]
    expected = km * ((kf / km - x - 1) * f + (1 + kf / km + x)) / ((1 - kf / km + x) * f + (1 + kf / km + x))
    assert result.effective_conductivity[[0, 1], [0, 1]] == pytest.approx(expected, rel=1e-6)
    assert result.conductivity_estimates.maxwell == pytest.approx(expected, rel=1e-12)
    assert result.conductivity_estimates.wiener is None


@pytest.mark.one_rank
@pytest.mark.parametrize(("geometry", "fraction", "h"), [("square", 0.65, 2.0), ("hexagonal", 0.75, 30.0)])
def test_close_fibres_with_kapitza_resistance(comm, geometry, fraction, h):
    """Rayleigh's series, in which a multipole of the order n sees the conductivity 1 / (1/k + n/(h a))."""
    case = {"geometry": geometry, "fibre_fraction": fraction, "order": 2, "mesh_size": 0.1, "refine": 1}
    k = solved(comm, matrix=1.0, fibre=20.0, interface={"conductance": h, "debonded": []}, **case)[:2, :2]
    area = {"square": 1.0, "hexagonal": np.sqrt(3) / 2}[geometry]  # of the cell of one fibre
    a = np.sqrt(fraction * area / np.pi)
    expected = axial_shear_modulus(geometry, fraction, lambda n: 1 / (1 / 20.0 + n / (h * a)))
    assert np.abs(k - expected * np.eye(2)).max() < 1e-5 * expected


@pytest.mark.one_rank
def test_coated_fibres_with_two_resistances(comm, shared_path):
    case = document(order=2, coating=0.15, mesh_size=0.1, fibre_fraction=0.3)
    case["material"]["coating"] = {"conductivity": 0.7}
    pairs = (["coating", "matrix"], 3.0), (["fibre", "coating"], 5.0)
    case["interface"] = [{"between": pair, "conductance": h, "debonded": []} for pair, h in pairs]
    k = run(Case.parse(case), comm, out=shared_path).effective_conductivity
    case["analysis"] = {"type": "stiffness", "plane": "generalized"}
    for bonds in case["interface"]:
        bonds |= {"axial_stiffness": bonds.pop("conductance"), "contact": False}
    phases = {name: 2 * (1 + POISSON) * own["conductivity"] for name, own in case["material"].items()}
    case["material"] = {name: {"young": young, "poisson": POISSON} for name, young in phases.items()}
    C = compute(Case.parse(case), comm).effective_stiffness
    assert k[:2, :2] == pytest.approx(C[np.ix_([4, 3], [4, 3])], rel=1e-11, abs=1e-11)
    if comm.rank == 0:
        certificate = verify(shared_path)
        assert certificate.holds and NO_REASON not in certificate.unchecked, certificate.text


@pytest.mark.one_rank
def test_bounds_and_maxwell_of_bonded_fibres(comm):
    result = compute(Case.parse(document(order=2)), comm)
    forms, f, k = result.conductivity_estimates, result.cell.fractions["fibre"], result.effective_conductivity
    assert forms.wiener == pytest.approx((1 / ((1 - f) / MATRIX + f / FIBRE), (1 - f) * MATRIX + f * FIBRE))
    maxwell = MATRIX * (FIBRE * (1 + f) + MATRIX * (1 - f)) / (FIBRE * (1 - f) + MATRIX * (1 + f))
    assert forms.maxwell == pytest.approx(maxwell) and forms.hashin_shtrikman[0] == pytest.approx(maxwell)
    assert forms.hashin_shtrikman[0] < k[0, 0] < forms.hashin_shtrikman[1] < forms.wiener[1]
    assert not result.remarks


@pytest.mark.one_rank
def test_fibre_that_is_debonded_all_around_insulates_like_a_void(comm, shared_path):
    if comm.rank == 0:
        write_voids(shared_path / "voids.msh", voids=[0])
        write_voids(shared_path / "whole.msh", voids=[])
    comm.barrier()
    loose, mesh = {"debonded": [{"fibre": "all", "angle": 360.0}]}, {"geometry": "mesh"}
    void = solved(comm, shared_path, fibre=None, file="voids.msh", voids=True, **mesh)
    for fibre in (0.1, 10.0):
        k = solved(comm, shared_path, fibre=fibre, interface=loose, file="whole.msh", **mesh)
        assert k[:2, :2] == pytest.approx(void[:2, :2], rel=1e-11, abs=1e-12)
        assert k[2, 2] - void[2, 2] == pytest.approx(fibre * (1 - void[2, 2] / MATRIX), rel=1e-11)
    expected = MATRIX * axial_shear_modulus("square", 0.4, 1e-12)
    fine = solved(comm, interface=loose, order=2, refine=1)
    assert fine[[0, 1], [0, 1]] == pytest.approx(expected, rel=5e-5)


@pytest.mark.parametrize("bonds", BONDS)
def test_files_hold_all_laws_and_show_a_falsified_entry(comm, shared_path, bonds):
    tensor = [[1.0, 0.2, 0.1], [0.2, 2.0, -0.3], [0.1, -0.3, 5.0]]
    fibre = FIBRE if bonds == "springs" else tensor
    run(Case.parse(document(fibre=fibre, **RANDOM, order=2, interface=BONDS[bonds])), comm, out=shared_path)
    if comm.rank == 0:
        certificate = verify(shared_path)
        assert certificate.holds and NO_REASON not in certificate.unchecked, certificate.text
        result = json.loads((shared_path / "result.json").read_text())
        result["effective_conductivity"][0][1] *= 1.001
        (shared_path / "result.json").write_text(json.dumps(result))
        broken = {finding.name for finding in verify(shared_path).findings if not finding.holds}
        assert {"tables", "symmetry"} <= broken
    comm.barrier()


@pytest.mark.one_rank
def test_sweeps_and_fits_take_entries(comm, shared_path):
    case = document(interface={"conductance": 3.0, "debonded": []}, mesh_size=0.3)
    del case["cell"]["fibre_fraction"]
    table = run_sweep(case | {"sweep": {"cell.fibre_fraction": [0.2, 0.4]}}, shared_path / "sweep", comm)
    if comm.rank == 0:
        f = table.outputs["fraction_meshed"]
        assert table.outputs["k33"] == pytest.approx((1 - f) * MATRIX + f * FIBRE, rel=1e-12)
        assert np.diff(table.outputs["k11"])[0] > table.outputs["k11_mesh_error"].max() > 0.0
    truth = compute(Case.parse(case | {"cell": case["cell"] | {"fibre_fraction": 0.4}}), comm).effective_conductivity
    start = {"interface": {"conductance": {"start": 1.0, "lower": 0.1, "upper": 50.0}}}
    measured = {"k11": {"value": float(truth[0, 0]), "std": 1e-3}}
    fit = run_fit(document(interface=case["interface"], mesh_size=0.3) | {"unknown": start, "measured": measured},
                  shared_path / "fit", comm)  # fmt: skip
    (estimate,) = fit["unknowns"].values()
    assert estimate["estimate"] == pytest.approx(3.0, rel=1e-5)
