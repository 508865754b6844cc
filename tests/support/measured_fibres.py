"""A table of fibres in a window, which are nearer to each other than those of random cells of that fraction."""

import numpy as np


def clustered_table(path, count=60, side=60.0, seed=4):
    """Discs with radii of 1.8 to 2.2, of which most are placed near another one, with gaps above 0.05; the path."""
    generator, fibres = np.random.default_rng(seed), []
    while len(fibres) < count:
        radius = generator.uniform(1.8, 2.2)
        place = generator.uniform(0, side, 2)
        if fibres and generator.random() < 0.8:
            place = fibres[generator.integers(len(fibres))][:2] + generator.normal(0, 3.5, 2)
        if np.any((place < 0) | (place > side)):
            continue
        if all(np.hypot(*(place - [x, y])) > radius + other + 0.05 for x, y, other in fibres):
            fibres.append((*place, radius))
    rows = [f"{x:.6f};{y:.6f};{radius:.6f}" for x, y, radius in fibres]
    path.write_text("\n".join([f"# width = {side}, height = {side}", "x;y;radius", *rows, ""]))
    return path
