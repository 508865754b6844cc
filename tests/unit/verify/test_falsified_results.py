"""Results of the program are verified; a copy with one false value breaks the laws that it must break."""

from dataclasses import replace

import numpy as np
import pytest
from support.falsifications import (
    MATRIX,
    SMALL,
    attribute,
    both,
    broken,
    check_what_is_left,
    document,
    scale,
    shift,
    swap_rows,
)
from support.verified_results import CASES, CONDUCTION, LOADS, MIXED_PATHS, falsified

from feti_homog.verify.certificate import verify
from feti_homog.verify.check_state import check_gluing
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, checks
from feti_homog.verify.reading import gradient, opened

pytestmark = pytest.mark.slow

MATERIAL = {"stress", "phases", "stress 33", "equilibrium", "mean stress", "Hill"}
SPRINGS = {"bond", "penetration", "complementarity"}
PATHS = (
    "path",
    "thinned",
    "friction",
    "friction by steps",
    "peaks",
    "energy",
    "softening",
    "pairs",
    "springs' energy",
    "increments",
    *MIXED_PATHS,
)
SPATIAL = ("spatial", "spatial contact", "spatial springs")
LINEAR = (SPATIAL[0], "derivatives")
ENVELOPES = ("envelope", "envelope by energy", "envelope in space")
MATERIAL_33 = MATERIAL | {"bounds"}


@pytest.mark.parametrize("kind", CASES)
def test_results_obey_every_law(results, kind):
    certificate = verify(results(kind))
    assert certificate.holds, certificate.text
    broken = {finding.name for finding in certificate.findings}
    assert broken >= {"stress", "equilibrium", "periodicity", "jump", "mean stress", "Hill", "load", "tables", "cell"}
    assert ("penetration" in broken) == (
        kind not in ("bonded", "rubber", "plane", "overlap", "load", *LINEAR, *ENVELOPES, *CONDUCTION)
    )
    assert ("energy" in broken) == (kind in (*PATHS, *LOADS, "loaded angle"))
    assert ("stress load" in broken) == (kind in (*MIXED_PATHS, *LOADS) or kind.startswith("friction"))
    check_what_is_left(kind, certificate)
    assert ("strength" in broken) == (kind in (*PATHS, *ENVELOPES[::2])) and ("onset" in broken) == (kind in ENVELOPES)
    assert ("moduli" in broken) == (kind in ("bonded", "rubber", "plane", *LINEAR, ENVELOPES[2]))
    assert ("compliance" in broken) == (kind in (*LINEAR, SPATIAL[1], ENVELOPES[2]))
    assert ("Levin" in broken) == (kind in (*LINEAR, SPATIAL[2], ENVELOPES[2]))


def other_fibre(_, file):
    number = file["interface/fibre_number"]
    number[0] = 1 if number[0] > 1 else 2


def other_pair(_, file):
    pair = file["interface/pair"]
    pair[0] = 1 - pair[0]


def length_and_traction(_, file):
    """With the same forces: what a node stands for is longer, and pulled less."""
    file["interface/length"][0] *= 1 + SMALL
    for state in file["state"].values():
        state["traction"][0] = state["traction"][0] / (1 + SMALL)


def case_of_fields(_, file):
    file.attrs["case"] = str(file.attrs["case"]).replace("0.299", "0.2991")


def errors_of_the_mesh(_, file):
    table = file["state/1/mesh_error"]
    table[()] = 3 * table[()]


def delete_state(_, file):
    del file[f"state/{len(file['state']) - 1}"]


FALSE = {
    "a largest stress": ("bonded", document("phase_stresses", 0, "principal", 1), {"phases"}),
    "a position": ("path", document("phase_stresses", 1, "von_mises_at", 0, 0, factor=1.01), {"phases"}),
    "one stress": ("bonded", scale("stress"), {"stress", "stress 33"}),
    "errors of the mesh": ("plane", errors_of_the_mesh, {"mesh error"}),
    "errors of mixed elements": ("bonded", errors_of_the_mesh, {"mesh error"}),
    "one stress of a path": ("path", scale("stress", state=7), {"stress", "stress 33"}),
    "a stress out of the plane": ("bonded", scale("stress_33"), {"stress 33"}),
    "one displacement": (
        "bonded", shift("displacement"), {"stress", "periodicity", "jump", "equilibrium", "mean stress"},
    ),
    "a displacement of rubber": (
        "rubber", shift("displacement"), {"stress", "periodicity", "jump", "equilibrium", "mean stress"},
    ),
    "one traction": ("bonded", scale("traction"), {"equilibrium"}),
    "one traction on rubber": ("rubber", scale("traction", 1.02), {"equilibrium"}),
    "one traction of a path": ("path", scale("traction", state=7), {"equilibrium"}),
    "a damage": ("softening", shift("damage", 0.01, state=3), {"bond", "breaks", "energy", "strength"}),
    "bonds that softened": ("softening", document("path", 3, "softened", to=9), {"breaks", "strength"}),
    "a toughness of a law that softens": (
        "softening", document("case", "interface", "normal_toughness", factor=1.01), {"strength", "energy"},
    ),
    "one jump": ("angle", scale("jump", state=3), {"jump"}),
    "tractions of two nodes": ("bonded", swap_rows("state/0/traction"), {"equilibrium"}),
    "an interface node moved": ("bonded", shift("points", 1e-3, group="interface"), {"interface", "jump"}),
    "a length": ("bonded", shift("length", group="interface"), {"interface", "equilibrium"}),
    "a normal": ("bonded", shift("normal", group="interface"), {"interface", "equilibrium"}),
    "fibres of two nodes": ("angle", other_fibre, {"interface", "tables"}),
    "a radius": ("bonded", shift("radius", group="fibre"), {"interface"}),
    "a centre": ("bonded", shift("centre", group="fibre"), {"interface"}),
    "a length with its traction": ("bonded", length_and_traction, {"interface"}),
    "the case in one file": ("bonded", case_of_fields, {"tables"}),
    "an arc": ("contact", document("case", "interface", "debonded", 0, "angle", factor=1.5), {"arcs"}),
    "where an arc is": ("angle", document("case", "interface", "debonded", 0, "centre", factor=5), {"arcs"}),
    "an angle": ("angle", document("angle", 1, "angle", to=170.0), {"arcs"}),
    "a mean stress": ("bonded", attribute("stress"), {"mean stress", "tables"}),
    "a strain": ("bonded", attribute("strain"), {"periodicity", "load"}),
    "a missing state": ("path", delete_state, {"load", "tables", "phases"}),
    "not a number": ("bonded", shift("stress", np.nan), {"numbers", "stress", "stress 33"}),
    "Poisson's ratio": ("bonded", document("case", *MATRIX, "poisson", factor=1 + 1e-4), MATERIAL_33),
    "the plane state": ("plane", document("case", "analysis", "plane", to="strain"), MATERIAL_33),
    "an angle of axes": ("angle", document("case", "material", "fibre", "angle"), MATERIAL - {"Hill"}),
    "contact that was not asked for": ("overlap", document("case", "interface", "contact", to=True), {"penetration"}),
    "an entry of the stiffness": ("bonded", document("effective_stiffness", 0, 1), {"tables", "moduli"}),
    "an entry under pressure": ("contact", document("effective_stiffness_compression", 1, 1), {"tables"}),
    "a stiffness of an angle": ("angle", document("angle", 1, "stiffness", 2, 2), {"tables"}),
    "a load factor in one file": ("path", attribute("load_factor", state=3), {"tables"}),
    "a load factor": (
        "path",
        both(attribute("load_factor", state=3), document("path", 3, "load_factor")),
        {"load"},
    ),
    "a stress of a point": ("path", document("path", 4, "stress", 0), {"mean stress"}),
    "bonds that broke": ("path", document("path", 4, "broke", factor=2), {"breaks", "strength"}),
    "a count of bonds": ("path", document("path", 4, "bonded", factor=2), {"tables", "breaks"}),
    "a stress of a point without fields": ("thinned", document("path", 1, "stress", 0, factor=1.01), {"energy"}),
    "a strain of a point without fields": ("thinned", document("path", 1, "strain", 0), {"load"}),
    "a count of a point without fields": ("thinned", document("path", 1, "bonded", factor=2), {"breaks", "tables"}),
    "the point of a state": (
        "thinned", attribute("point", factor=2, state=1),
        {"load", "tables", "mean stress", "breaks", "energy", "strength"},
    ),
    "the points of states": ("thinned", document("states", 1, factor=2), {"tables"}),
    "more states than were asked for": ("thinned", document("case", "output", "states", to=6), {"load"}),
    "a strength too low": ("path", document("case", "interface", "normal_strength", factor=0.99), {"strength"}),
    "a strength too high": ("path", document("case", "interface", "normal_strength", factor=1.01), {"strength"}),
    "a strength of steps": ("increments", document("case", "interface", "normal_strength", factor=0.5), {"strength"}),
    "a stiffness of springs": ("springs", document("case", "interface", "normal_stiffness", factor=1.01), SPRINGS),
    "a toughness too low": ("energy", document("case", "interface", "toughness", factor=0.98), {"strength", "energy"}),
    "a dissipated energy": ("path", document("path", 5, "dissipated", factor=1.01), {"energy"}),
    "a rising dissipation": ("path", document("path", 5, "dissipated_strain_controlled", factor=1.01), {"energy"}),
    "a dissipation of increments": ("increments", document("path", 11, "dissipated", factor=-1.0), {"energy"}),
    "an energy stored": ("path", document("path", 5, "stored", factor=1.01), {"energy"}),
    "an energy stored at a point without fields": ("thinned", document("path", 1, "stored", factor=1.01), {"energy"}),
    "an energy stored at an angle": ("loaded angle", document("angle", 1, "stored", factor=1.01), {"energy"}),
    "an energy of springs": ("energy", document("path", 5, "stored_in_springs", factor=1.01), {"energy"}),
    "energy of springs that there are none of": ("path", document("path", 5, "stored_in_springs", to=0.01), {"energy"}),
    "an energy of fracture": ("energy", document("path", 5, "fracture_energy", factor=1.01), {"energy"}),
    "an energy of fracture of increments": (
        "springs' energy", document("path", -1, "fracture_energy", factor=1e3), {"energy"},
    ),
    "a debonded length": ("path", document("path", 5, "debonded_length", 0), {"tables"}),
    "a debonded share": ("thinned", document("path", -1, "debonded_share"), {"tables"}),
    "no debonded lengths": ("thinned", lambda content, _: content["path"][-1].pop("debonded_length"), {"tables"}),
    "no debonded shares": ("pairs", lambda content, _: content["path"][-1].pop("debonded_shares"), {"tables"}),
    "the place of a tip": ("energy", document("path", 5, "tips", "angle", 0), {"tables"}),
    "the fibre of a tip": ("springs' energy", document("path", -1, "tips", "fibre", 0, to=7), {"tables"}),
    "the mode of a tip": ("energy", document("path", 5, "tips", "psi", 0), {"tables"}),
    "an energy of a tip": ("springs' energy", document("path", -1, "tips", "G_I", 0), {"tables"}),
    "what drives a tip": (
        "energy", both(*(document("path", 5, "tips", name, 0, factor=9.0) for name in ("G_I", "G_II"))), {"strength"},
    ),
    "a jump without a change of contact": (
        "jump", both(document("path", 7, "closed", to=4), document("path", 7, "open", to=15)), {"strength", "tables"},
    ),
    "a jump away from the point before": (
        "jump", document("path", 7, "stress", 0, factor=1.01), {"strength", "mean stress", "energy"},
    ),
    "a jump that breaks nothing": ("jump", document("path", 8, "broke", to=0), {"strength", "breaks", "energy"}),
    "a jump before contact changes": (
        "jump", both(*(document("path", 7, "tips", name, 0, factor=1.4) for name in ("G_I", "G_II"))), {"strength"},
    ),
    "a missing tip": ("energy", lambda content, _: content["path"][5]["tips"]["psi"].pop(), {"tables"}),
    "a debonded share of a pair": ("pairs", document("path", -1, "debonded_shares", 1), {"tables"}),
    "the interface of a tip": ("pairs", document("path", -1, "tips", "interface", 0, to=7), {"tables"}),
    "no interfaces of tips": ("pairs", lambda content, _: content["path"][-1]["tips"].pop("interface"), {"tables"}),
    "pairs of two nodes": ("pairs", other_pair, {"interface", "tables"}),
    "a waypoint": ("increments", document("case", "path", "waypoints", 1, 0), {"load"}),
    "a modulus": ("bonded", document("moduli", "E1"), {"moduli"}),
    "a Poisson's ratio": ("bonded", document("moduli", "nu12", factor=1 + 2e-10), {"moduli"}),
    "a bound": ("bonded", document("bounds", "hashin_shtrikman", "shear", 1), {"bounds"}),
    "a fraction": ("bonded", document("cell", "fractions", "fibre"), {"cell"}),
    "an area": ("bonded", document("cell", "area"), {"cell"}),
    "a number of elements": ("bonded", document("cell", "elements", to=1), {"cell"}),
}  # fmt: skip


@pytest.mark.parametrize("name", FALSE)
def test_a_falsified_copy_breaks_its_laws(results, tmp_path, name):
    kind, edit, laws = FALSE[name]
    assert broken(falsified(results(kind), tmp_path / "copy", edit)) == laws | {"files"}


def test_displacements_that_fit_their_stresses_break_equilibrium_alone(results, tmp_path):
    """A node is moved with its fluctuation, and the stresses of its elements after it."""

    def edit(_, file):
        with opened(results("bonded")) as files:
            cell, state = DiscreteCell.of(files), next(files.states())
        inner = np.setdiff1d(np.arange(len(state.fluctuation)), cell.nodes.node)[3]
        state.fluctuation[inner] += SMALL
        displacement = state.fluctuation + cell.files.mesh.points @ gradient(state.strain).T
        file["state/0/displacement"][()] = displacement
        file["state/0/stress"][()] = cell.elements.fields(displacement, displacement, 0.0, cell.expansions).stress

    assert broken(falsified(results("bonded"), tmp_path / "copy", edit)) - {"stress 33"} == {"equilibrium", "files"}


def test_the_held_place_may_collect_the_rounding_of_all_others_and_no_more(results):
    """Terms are large and forces are not, as beside a phase that is far stiffer than it is strained."""
    rng, limits = np.random.default_rng(1), []
    with opened(results("bonded")) as files:
        cell, state = DiscreteCell.of(files), next(files.states())
        displacement = state.displacement
        fields = cell.elements.fields(displacement, np.abs(displacement), 0.0, cell.expansions)
        fields = replace(fields, force_size=1e6 * fields.force_size)
        inner = np.setdiff1d(np.arange(len(displacement)), cell.nodes.node)
        held = np.flatnonzero((state.fluctuation == 0).all(axis=1))[0]
        noise = np.zeros_like(displacement)
        noise[inner] = 0.5e-15 * fields.force_size.max() * rng.choice([-1.0, 1.0], (len(inner), 2))
        noise[held] = -noise.sum(axis=0)
        assert np.abs(noise[held]).max() > 4 * np.abs(noise[inner]).max()
        for added in (noise, 10 * noise, np.roll(noise, inner[0] - held, axis=0)):
            findings = Findings(checks(1e-8, users_mesh=False))
            check_gluing(findings, cell, state, replace(fields, force=fields.force + added))
            limits.append(next(found.holds for found in findings.worst() if found.name == "equilibrium"))
    assert limits == [True, False, False]
