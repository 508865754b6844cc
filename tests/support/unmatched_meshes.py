"""Meshes of rectangles with discs, some cut by the sides, whose opposite sides do not match."""

from pathlib import Path

import gmsh
import numpy as np


def discs_in(width: float, height: float, count: int, radius: float, seed: int) -> np.ndarray:
    """Centres (n, 2) of at most `count` random discs with gaps, about the sides too."""
    rng, centres = np.random.default_rng(seed), np.zeros((0, 2))
    for centre in rng.uniform(-0.5, 1.5, (400, 2)) * [width, height]:
        outside = np.linalg.norm(centre - np.clip(centre, 0, [width, height]))
        off = np.abs(np.concatenate([centre, centre - [width, height], [outside]]))
        clear = (np.linalg.norm(centres - centre, axis=1) > 2.3 * radius).all()
        # Neither tangent to a side nor beside a corner.
        corners = np.array([[0, 0], [width, 0], [0, height], [width, height]])
        clear &= np.linalg.norm(centre - corners, axis=1).min() > 1.3 * radius
        if clear and outside < 0.7 * radius and (np.abs(off - radius) > 0.25 * radius).all():
            centres = np.vstack([centres, centre])
    return centres[:count]


def write_discs(
    path: Path,
    centres: np.ndarray,
    radius: float,
    width: float = 1.0,
    height: float = 1.0,
    size: float = 0.1,
    origin: tuple[float, float] = (0.0, 0.0),
    order: int = 1,
    voids: bool = False,
    several: tuple[int, int, int, int] = (0, 0, 0, 0),
) -> None:
    """Write a mesh by gmsh: elements of the given size, sides with so many nodes more than their opposites.

    `several` elements on the lower, right, upper and left side; 0 leaves them to gmsh.
    """
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        cell = (2, occ.addRectangle(*origin, 0, width, height))
        discs = [(2, occ.addDisk(x + origin[0], y + origin[1], 0, radius, radius)) for x, y in centres]
        parts, images = occ.fragment([cell], discs) if discs else ([cell], [[cell]])
        inside = set(images[0])
        occ.remove([part for part in parts if part not in inside], recursive=True)
        fibres = sorted(inside & {part for image in images[1:] for part in image})
        if voids:
            occ.remove(fibres, recursive=False)
        occ.synchronize()
        matrix = sorted(inside - set(fibres))
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in matrix], name="matrix")
        if fibres and not voids:
            gmsh.model.addPhysicalGroup(2, [tag for _, tag in fibres], name="fibre")
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 14)
        ends = np.array([[0, 0, width, 0], [width, 0, width, height], [0, height, width, height], [0, 0, 0, height]])
        for box, elements in zip(ends, several, strict=True) if any(several) else ():
            low, high = box[:2] + origin - 1e-6, box[2:] + origin + 1e-6
            for _, curve in gmsh.model.getEntitiesInBoundingBox(*low, -1, *high, 1, dim=1):
                gmsh.model.mesh.setTransfiniteCurve(curve, elements + 1)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
