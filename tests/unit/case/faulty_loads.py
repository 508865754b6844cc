"""Case files with faults of loads by name, of [path] and [load], below the words that must report them."""

from support.base_case import AXIAL, FIBRE, TRANSVERSE, faults
from unit.case.faulty_bonding import ARC, PATH, of_type


def path(*lines: str, state: str = "strain") -> str:
    return of_type("path", "[path]", *lines).replace('"strain"', f'"{state}"')


def load(*lines: str, state: str = "strain") -> str:
    return of_type("load", "[load]", *lines).replace('"strain"', f'"{state}"')


FAULTY_LOADS: dict[str, str] = {
    **faults(path(state="generalized"), {
        "[path] strain = [1, 0, 0]":
            'belongs to [analysis] plane = "strain" or "stress", not "generalized"; use to = {E11 = ...}',
    }),
    **faults(of_type("path", "[path]"), {
        "[path] to = {}": "expected a table of strains and stresses such as {S11 = 60.0, S22 = 0.0}",
        "[path] waypoints = [{S11 = 1.0}, {}]":
            "expected a list of strains [E11, E22, gamma12] or of tables such as {S11 = 60.0}",
        "[path] to = {S11 = 0.0}": "expected a load other than zero, where the path begins",
    }),
    **faults(of_type("load"), {
        "[load] to = {}": "expected a table of strains and stresses such as {S11 = 60.0, S22 = 0.0}",
        "[load] to = [1, 0, 0]": "expected a table of strains and stresses",
    }),
    **faults(of_type("path", PATH), {
        "[interface] axial_strength = 3.0": 'belongs to [analysis] plane = "generalized", not',
    }),
    "[path] strain, to, waypoints: exclude each other; give one":
        path("strain = [1, 0, 0]", "to = {S11 = 1.0}", "waypoints = [{S11 = 1.0}]"),
    "[path] strain, to: exclude each other; give one": path("strain = [1, 0, 0]", "to = {S11 = 1.0}"),
    "[path] strain, to, waypoints: missing; give one": path(state="generalized"),
    '[path] waypoints[1] = [1, 0, 0]: expected a table such as {E11 = 0.01} in [analysis] plane = "generalized"':
        path("waypoints = [{S33 = 1.0}, [1, 0, 0]]", state="generalized"),
    "[path] to.E11, to.S11: exclude each other; give one": path("to = {E11 = 0.1, S11 = 1.0}"),
    "[path] waypoints[1].gamma13, waypoints[1].S13: exclude each other; give one":
        path("waypoints = [{S11 = 1.0}, {gamma13 = 0.1, S13 = 1.0}]", state="generalized"),
    "[load] to.E12 = 0.1: unknown key; expected a shear strain as gamma12 = 2 E12": load("to = {E12 = 0.1}"),
    "[load] to.gamma12, to.S12: exclude each other; give one": load("to = {gamma12 = 0.1, S12 = 1.0}"),
    "[path] to.s11 = 1.0: unknown key; did you mean S11?": path("to = {s11 = 1.0}"),
    "[path] waypoints[1].gama12 = 1.0: unknown key; did you mean gamma12?":
        path("waypoints = [[1, 0, 0], {gama12 = 1.0}]"),
    "[load] to.young = 1.0: unknown key; it belongs to [material.PHASE]": load("to = {young = 1.0}"),
    '[path] to.E33 = 0.1: belongs to [analysis] plane = "generalized", not "strain"':
        path("to = {S11 = 1.0, E33 = 0.1}"),
    '[load] to.S13 = 1.0: belongs to [analysis] plane = "generalized", not "stress"':
        load("to = {S13 = 1.0}", state="stress"),
    '[path] waypoints[0].temperature = -100.0: belongs to [analysis] plane = "generalized", not "strain"':
        path("waypoints = [{temperature = -100.0}]"),
    "[material.matrix] expansion: missing; [path] waypoints[1].temperature needs it\n"
    "[material.fibre] expansion: missing; [path] waypoints[1].temperature needs it":
        path("waypoints = [{S11 = 1.0}, {temperature = -100.0}, {temperature = 0.0}]", state="generalized"),
    "[material.matrix] expansion: missing; [load] to.temperature needs it":
        load("to = {temperature = -100.0}", state="generalized").replace("0.222", "0.222\nexpansion = 1e-6"),
    "[material.fibre] poisson: missing; expected a number above -1\n"
    "[material.fibre] expansion: missing; [load] to.temperature needs it":
        load("to = {temperature = -100.0}", state="generalized").replace("0.299", "0.299\nexpansion = 1e-5")
        .replace("poisson = 0.222\n", ""),
    "[material.fibre] expanson = 1e-06: unknown key; did you mean expansion?":
        load("to = {temperature = -100.0}", state="generalized").replace("0.299", "0.299\nexpansion = 1e-5")
        .replace("0.222", "0.222\nexpanson = 1e-6"),
    "[material.fibre] expansion_axial, expansion_transverse, or one expansion: missing; [load] to.temperature needs it":
        load("to = {temperature = -100.0}", state="generalized").replace("0.299", "0.299\nexpansion = 1e-5")
        .replace(FIBRE, f"[material.fibre]\n{TRANSVERSE}{AXIAL}G_axial = 15.0\n"),
    "[load] to.dT = -100.0: unknown key; did you mean temperature?": load("to = {dT = -100.0}", state="generalized"),
    '[path] to.S11 = "60": expected a number': path('to = {S11 = "60"}'),
    "[load] to.E11 = true: expected a number": load("to = {E11 = true}"),
    "[path] to.S11 = nan: expected a number": path("to = {S11 = nan}"),
    "[path] waypoints[0].S11 = 1e+101: expected a number; numbers other than 0 have magnitudes":
        path("waypoints = [{S11 = 1e101}]"),
    "[load] to = {E11 = 0.0, S22 = 0.0}: expected a load other than zero": load("to = {E11 = 0.0, S22 = 0}"),
    "[path] waypoints[0] = {E22 = 0.0}: expected a load other than zero, where the path begins":
        path("waypoints = [{E22 = 0.0}, {S11 = 1.0}]"),
    "[path] waypoints[1] = {E22 = 0.1, S12 = 0.0}: expected a load other than waypoints[0]\n"
    "[path] waypoints[2] = {S11 = 1.0}: expected a load other than waypoints[1]":
        path("waypoints = [{S11 = 1.0, E22 = 0.1}, {E22 = 0.1, S12 = 0.0}, {S11 = 1.0}]", state="stress"),
    "[path] waypoints[1] = [1.0, 0.0, 0.0]: expected a strain other than waypoints[0]":
        path("waypoints = [{E11 = 1.0, E22 = 0.0, gamma12 = 0.0}, [1, 0, 0]]"),
    "[path] increments = 1: expected at least one for each":
        path("waypoints = [{S11 = 1.0}, {S11 = 0.0}]", 'method = "increments"', "increments = 1"),
    '[load]: missing section; [analysis] type = "load" needs it': of_type("load"),
    "[load] to: missing; expected a table of strains and stresses": load(),
    '[load]: belongs to [analysis] type = "load", not "path"': of_type("path", PATH, "[load]", "to = {S11 = 1.0}"),
    '[path]: belongs to [analysis] type = "path", not "load"': load("to = {S11 = 1.0}", "[path]", "strain = [1, 0, 0]"),
    '[interface] normal_strength = 1.0: belongs to [analysis] type = "path" or "envelope", not "load"':
        load("to = {S11 = 1.0}", "[interface]", f"debonded = [{ARC}]", "normal_strength = 1.0"),
    "[interface] debonded: missing; expected a list of arcs":
        load("to = {S11 = 1.0}", "[interface]", "contact = false"),
    "[path] waypoints[0].S11 = true: expected a number\n"
    "[path] waypoints[0].E33 = 1: belongs to\n"
    "[path] waypoints[1].E22, waypoints[1].S22: exclude each other; give one\n"
    "[path] waypoints[2].S1 = 1: unknown key; did you mean \n"
    "[path] to.S12 = []: expected a number":
        path("waypoints = [{S11 = true, E33 = 1}, {E22 = 1, S22 = 2}, {S1 = 1}]", "to = {S12 = []}"),
}  # fmt: skip
