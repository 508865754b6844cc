"""Meshes of layers that run through the cell, normal to either axis."""

from unit.mesh.faulty_meshes import FIBRE, MATRIX, MshFile

ALONG = 2


def layers(phases: str, across: int) -> MshFile:
    """Return a unit cell of equal columns, or rows, of squares cut in two: one for each letter of `phases`, M or F."""
    n = len(phases)

    def node(i: int, j: int) -> int:
        return 1 + i * (ALONG + 1) + j

    def place(i: int, j: int) -> tuple[float, float, float]:
        x, y = (i / n, j / ALONG) if across == 0 else (j / ALONG, i / n)
        return x, y, 0.0

    nodes = {node(i, j): place(i, j) for i in range(n + 1) for j in range(ALONG + 1)}
    elements = {}
    for i, letter in enumerate(phases):
        phase = MATRIX if letter == "M" else FIBRE
        for j in range(ALONG):
            a, b, c, d = node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)
            for corners in ((a, b, c), (a, c, d)):
                ordered = corners if across == 0 else corners[::-1]
                elements[len(elements) + 1] = (2, phase, phase, ordered)
    return MshFile(nodes, elements)
