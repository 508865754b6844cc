"""The laws of the certificate and the largest violation of each that rounding or the solver's tolerance explains.

Rounding.  What is computed from the fields by sums of a few terms is off by some units in the last place of the terms;
what the solver gets from factorizations, by some hundred: forces of 119 000 elements by 1.3e-12 at most.  Where a phase
is so stiff that its strains are differences of nearly equal displacements, 1e-15 of the terms are rounding too.
The limits are ten to a thousand times what was measured.

Solver.  The Krylov method ends with jumps of `rtol`, relative; laws that need glued faces to be closed hold as far as
the checks of a run demand, min(1000 rtol, 1e-4).  `rtol` is written in the result, so the second number is the most
that any result may claim.
"""

from __future__ import annotations

from feti_homog.verify.ledger import Law

CHECK_PER_RTOL, LARGEST_CHECK = 1e3, 1e-4
# Signs of forces and gaps are the solver's error below 10 rtol of the largest; the check of contact allows 1e-6.
CONTACT_PER_RTOL, LEAST_CONTACT = 100.0, 1e-6
# Bonds whose utilisation differs by 1e-6 break together.
STRENGTH = 2e-6
# Utilisations at onset, from the same tractions as the onset.
ONSET = 1e-9
# Coordinates of a user's mesh are rounded: sides match to 1e-7 of the cell, circles are round to 1e-6 of their radius.
OWN_MESH, USERS_MESH = 1e-9, 1e-5
# Thin coatings bend by the rounding of the forces on their two faces: measured 4e-9 at a hundredth of the radius.
WHOLE_BODIES, COATINGS = 1e-11, 1e-7


def laws(rtol: float, users_mesh: bool, has_coatings: bool) -> tuple[Law, ...]:
    """The laws of a result whose dual problems were solved to the relative tolerance `rtol`."""
    rounding = COATINGS if has_coatings else WHOLE_BODIES
    shape = USERS_MESH if users_mesh else OWN_MESH
    solver = min(CHECK_PER_RTOL * rtol, LARGEST_CHECK)
    contact = min(max(CONTACT_PER_RTOL * rtol, LEAST_CONTACT), LARGEST_CHECK)
    return (
        Law("files", "the files are those that the run wrote, by their checksums", 0.0),
        Law("numbers", "all numbers are finite", 0.0),
        Law("mesh", "elements have positive areas and fill the cell; torn sides meet in pairs", shape),
        Law("interface", "interface nodes are where one fibre meets the matrix, with its normals and lengths", shape),
        Law("arcs", "debonded from the start is what the case says, in numbers of nodes", 0.0),
        Law("displacement", "u = E x + u*, relative to its terms", 1e-13),
        Law("stress", "stresses of the elements follow from u and the case's materials", 1e-13),
        Law("stress 33", "stresses out of the plane follow from those in it and the case's materials", 1e-13),
        Law("shown", "strains, von Mises and principal stresses follow from these, in single precision", 3e-7),
        Law("vectors", "vectors and the faces' displacements follow from tractions, jumps and displacements", 1e-13),
        Law("periodicity", "u* is the same at the copies of a node in its subdomain, relative to the largest u", 1e-13),
        Law("continuity", "u* is the same where subdomains are glued, relative to the largest u", solver),
        Law(
            "equilibrium", "forces of the elements and tractions balance at every node, relative to the largest", 1e-10
        ),
        Law("jump", "gap and slip are the differences of the faces' u*, relative to the largest u", rounding),
        Law(
            "bond",
            "bonded and closed faces part as their springs give way, relative to the largest u",
            solver,
        ),
        Law("penetration", "debonded faces do not overlap, relative to the displacement imposed", contact),
        Law("tension", "closed faces are not pulled, relative to the largest traction", contact),
        Law("complementarity", "gap times traction vanishes, relative to the largest force and displacement", contact),
        Law("free faces", "open faces bear nothing, closed ones no shear, relative to the largest traction", contact),
        Law("mean stress", "the mean of the stresses is the state's, relative to the largest component", 1e-10),
        Law("mean strain", "the mean of the strains is E and the opening of the faces, relative to E", solver),
        Law("Hill", "mean of stress : strain = mean stress : E less the interface's work, relative to it", solver),
        Law(
            "load",
            "the states have the strains and temperatures that the case asks for, relative to the largest",
            1e-12,
        ),
        Law("stress load", "the states have the stresses that the case asks for, relative to the largest", solver),
        Law("tables", "points and columns in result.json are the states in result.h5, relative to the largest", 1e-12),
        Law("CSV", "the tables of points beside result.json say what that says", 0.0),
        Law("symmetry", "stiffnesses of bonded or free faces are symmetric, relative to the largest entry", solver),
        Law("breaks", "bonds break as the points say and never heal, in numbers of bonds", 0.0),
        Law("strength", "bonds that hold are within their strength, those that break are at it", STRENGTH),
        Law("onset", "the load of every direction of an envelope is that at which the first bond breaks", ONSET),
        Law("energy", "work = stored + dissipated along the path, relative to the largest energy", solver),
        Law("cell", "areas, fractions and counts in result.json are those of the mesh", 1e-10),
        Law("moduli", "moduli follow from the stiffness, relative to each", 1e-10),
        Law("compliance", "compliance and expansion follow from stiffness and thermal stress, relative to each", 1e-10),
        Law("Levin", "thermal stress = - mean of expansion : stiffness : strain under unit strains, relative", solver),
        Law("bounds", "bounds follow from fractions and materials, and the stiffness is between them", 1e-10),
    )
