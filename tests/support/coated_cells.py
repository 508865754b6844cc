"""Meshes of square cells with one fibre in two rings, whose phases are named as a test wants them."""

import gmsh

RADIUS, INNER = 0.35, 0.25


def write(path, core, ring, size=0.09):
    """Mesh the cell of width 1 whose fibre has the phase `core` up to the radius INNER, and `ring` up to RADIUS."""
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Verbosity", 0)
    try:
        _add(core, ring, size)
        gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def _add(core, ring, size):
    occ = gmsh.model.occ
    square = (2, occ.addRectangle(0.0, 0.0, 0.0, 1.0, 1.0))
    discs = [(2, occ.addDisk(0.5, 0.5, 0.0, radius, radius)) for radius in (RADIUS, INNER)]
    _, parts = occ.fragment([square], discs)
    occ.synchronize()
    inner = {tag for _, tag in parts[2]}
    outer = {tag for _, tag in parts[1]} - inner
    matrix = {tag for _, tag in parts[0]} - inner - outer
    phases = {}
    for name, tags in (("matrix", matrix), (core, inner), (ring, outer)):
        phases.setdefault(name, set()).update(tags)
    for name, tags in phases.items():
        gmsh.model.addPhysicalGroup(2, sorted(tags), name=name)
    sides = [curve for _, curve in gmsh.model.getEntities(1)]
    for curve in sides:
        xmin, ymin, _, xmax, ymax, _ = gmsh.model.getBoundingBox(1, curve)
        if ymax - ymin < 1e-6 or xmax - xmin < 1e-6:
            gmsh.model.mesh.setTransfiniteCurve(curve, round(1 / size) + 1)
        else:
            gmsh.model.mesh.setTransfiniteCurve(curve, 4 * round(1.57 * INNER / size) + 1)
    gmsh.model.mesh.generate(2)
