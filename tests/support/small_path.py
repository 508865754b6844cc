"""A path of a few events on a tiny cell."""

from support.base_case import BASE

PATH = (
    BASE.replace('"hexagonal"', '"square"')
    .replace("mesh_size = 0.05", "mesh_size = 0.3")
    .replace('"stiffness"', '"path"')
) + (
    "[interface]\nnormal_strength = 4.0\ntangential_strength = 4.0\n"
    "[path]\nstrain = [0.2, 0.0, 0.0]\n[output]\npictures = false\n"
)
