"""Case files without faults, of all kinds."""

from support.base_case import (
    AXIAL,
    BASE,
    MESH_CELL,
    ORTHOTROPIC,
    OUT_OF_PLANE,
    RANDOM,
    SPATIAL,
    TABLE_CELL,
    TRANSVERSE,
    changed,
    fibre,
)
from unit.case.faulty_bonding import ANGLE, ARC, BARE_ARC, PATH, debonded, of_type
from unit.case.faulty_envelopes import BONDS, envelope
from unit.case.faulty_materials import conducting

MESH = changed(MESH_CELL)


def in_space(case: str, bonds: str = "") -> str:
    """Return a case in generalized plane strain, whose phases expand."""
    expands = case.replace("poisson = 0.299", "poisson = 0.299\nexpansion = 1e-5").replace(
        "poisson = 0.222", "poisson = 0.222\nexpansion = 2e-5"
    )
    return expands.replace('"strain"', '"generalized"') + bonds + "\n"


VALID_CASES = {
    "base": BASE,
    "accuracy": BASE.replace("mesh_size = 0.05", "accuracy = 1e-3"),
    "named, with options": "name = 'Zelle'\n"
    + BASE
    + "[decomposition]\nmax_dofs = 5000\n[petsc]\nfeti_ksp_rtol = 1e-8\nfeti_view = true\n",
    "random": changed(('geometry = "hexagonal"\n', RANDOM + "seed = 7\nradius_spread = 0.2\n")),
    "fine interfaces": changed(("mesh_size = 0.05", "mesh_size = 0.05\ninterface_size = 0.05\ntip_size = 1e-5")),
    "table": changed(TABLE_CELL),
    "table of two phases": changed(
        (
            TABLE_CELL[0],
            'geometry = "table"\nwindow = "cut"\nwidth = 1.0\nheight = 2\nfibre_list = ['
            '{x = -0.5, y = 0, radius = 0.1}, {x = 0, y = 1.5, radius = 0.1, phase = "fibre:2"}]',
        ),
        end='[material."fibre:2"]\nyoung = 3.0\npoisson = 0.1\n',
    ),
    "mesh of three phases": MESH + '[material."fibre:2"]\nstiffness = [[3, 1, 0], [1, 3, 0], [0, 0, 1]]\n',
    "orthotropic": fibre("E1 = 10.0\nE2 = 5.0\nE3 = 5.0\nnu12 = 0.3\nnu13 = 0.3\nnu23 = 0.2\nG12 = 2.0\nangle = 30\n"),
    "orthotropic in space": fibre(
        ORTHOTROPIC + OUT_OF_PLANE + "G13 = 2.0\nG23 = 1.5\nangle = 30\nexpansion = [1e-6, 2e-6, 3e-6]\n", "generalized"
    ),
    "transversely isotropic": fibre(
        TRANSVERSE + AXIAL + "G_axial = 28.0\nexpansion_axial = -0.9e-6\nexpansion_transverse = 9e-6\n", "generalized"
    ),
    "transversely isotropic, plane strain": fibre(TRANSVERSE + AXIAL + "expansion = 0\n"),
    "transversely isotropic, plane stress": fibre(TRANSVERSE, "stress"),
    "stiffness in space": fibre(SPATIAL + "expansion = 1e-6\n", "generalized"),
    "stiffness in space, plane stress": fibre(SPATIAL + "expansion = [1, 2, 3]\n", "stress"),
    "expansion": fibre("young = 3\npoisson = 0.3\nexpansion = 2e-5\n"),
    "angle in space": of_type("angle", ANGLE, BARE_ARC).replace('"strain"', '"generalized"'),
    "output": BASE + '[output]\nfields = false\nstress = "S12"\ndeformation_scale = 2\nlength_unit = "µm"\n',
    "arc": BASE + f"[interface]\ndebonded = [{ARC}]\n",
    "no arc": BASE + "[interface]\ncontact = false\ndebonded = []\n",
    "springs": BASE + "[interface]\nnormal_stiffness = 10.0\n",
    "energy": of_type(
        "path",
        PATH,
        "[interface]\nnormal_stiffness = 10\ntangential_stiffness = 5",
        'criterion = "energy"\ntoughness = 2\ngrowth = "springs"\nmode_sensitivity = 0',
    ),
    "conductivity": conducting("[interface]", f"debonded = [{ARC}]", "conductance = 2.0"),
    "conductivity, of a tensor, and a stiffness": conducting(
        fibre="young = 3\npoisson = 0.3\nstrength = {von_mises = 3.0}\n"
        "conductivity = [[2.0, 0.5, 0.1], [0.5, 1, 0], [0.1, 0, 1]]"
    ),
    "conductivity along and across": conducting(fibre="conductivity = {axial = 10.0, transverse = 1.0}").replace(
        "mesh_size = 0.05", "accuracy = 1e-3"
    ),
    "stiffness of conducting phases": fibre("young = 3\npoisson = 0.3\nconductivity = 2.0\n"),
    "scatter": of_type("path", "[path]\nstrain = [0.1, 0, 0]", "[interface]\nscatter = {shape = 8.0, seed = 2}"),
    "curve of a mesh": MESH + "[interface]\n",
    "angle": of_type("angle", ANGLE, BARE_ARC, "contact = false"),
    "angle under a strain": of_type(
        "angle", ANGLE, "strain = [0, 0, 0.2]", '[[interface.debonded]]\nfibre = "all"\ncentre = 90'
    ),
    "path": of_type("path", PATH),
    "envelope": envelope('["S22", "S12"]'),
    "envelope of a cracked cell": envelope('["E11", "E22"]', bonds=f"{BONDS}\ncontact = false\ndebonded = [{ARC}]"),
    "envelope in space": envelope(
        '["S33", "S13"]',
        "directions = 8",
        state="generalized",
        bonds="[interface]\naxial_strength = 3.0\naxial_stiffness = 2.0",
    ),
    "envelope of bonds that nothing along the fibres breaks": envelope(
        '["S33", "S13"]', state="generalized", bonds=f"{BONDS}\naxial_strength = inf\naxial_stiffness = inf"
    ),
    "envelope after cooling": fibre("young = 3\npoisson = 0.3\nexpansion = 2e-5\n")
    .replace("poisson = 0.299", "poisson = 0.299\nexpansion = 1e-5")
    .replace('"strain"', '"generalized"')
    .replace('"stiffness"', '"envelope"')
    + f'{BONDS}\n[envelope]\nplane = ["S22", "S12"]\ntemperature = -100\n',
    "path, few states": of_type("path", PATH, "[output]\nstates = 7"),
    "path, its peaks": of_type("path", PATH, '[output]\nstates = "peaks"'),
    "path to a load": of_type("path", "[path]\nto = {S11 = 60, E22 = 0.0}"),
    "path of loads and strains": of_type(
        "path", "[path]\nwaypoints = [{S11 = 60}, [1, 0, 0], {gamma12 = 1}, {S12 = 1}, {S12 = 0}]"
    ),
    "path in space": in_space(
        of_type("path", "[path]\nwaypoints = [{temperature = -100}, {S11 = 60, gamma13 = 0.1}, {S11 = 0, S13 = 0}]"),
        bonds="[interface]\naxial_strength = 3.0\naxial_stiffness = 2.0",
    ),
    "increments in space": in_space(
        of_type("path", "[path]\nto = {E33 = 0.1}", 'method = "increments"', "increments = 5")
    ),
    "load": of_type("load", "[load]\nto = {E11 = 0.02, S22 = 0.0, S12 = 1}"),
    "load on a sheet": of_type("load", "[load.to]\nS12 = 1").replace('"strain"', '"stress"'),
    "load in space": in_space(of_type("load", "[load.to]\nS33 = 1.0\nS23 = -2.0\ntemperature = 20")),
    "load on debonded fibres": of_type("load", "[load]\nto = {S22 = 1.0}", f"[interface]\ndebonded = [{ARC}]"),
    "path there and back": of_type("path", "[path]\nwaypoints = [[1, 0, 0], [0, 0, 0]]\nmax_events = 7"),
    "increments": of_type("path", PATH, 'method = "increments"\nincrements = 50\nrelease = "worst"'),
    "strengths": debonded("{fibre = [1, 2], angle = 360}", "normal_strength = inf\ntangential_strength = 3"),
    "criterion": debonded(f'{ARC}, {{fibre = "all", angle = 0}}', 'normal_strength = 1\ncriterion = "quadratic"'),
}
