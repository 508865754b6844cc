"""Paths: of a few events on a tiny cell, and of many on a sheet."""

from support.base_case import BASE

PATH = (
    BASE.replace('"hexagonal"', '"square"')
    .replace("mesh_size = 0.05", "mesh_size = 0.3")
    .replace('"stiffness"', '"path"')
) + (
    "[interface]\nnormal_strength = 4.0\ntangential_strength = 4.0\n"
    "[path]\nstrain = [0.2, 0.0, 0.0]\n[output]\npictures = false\n"
)

SHEET_PATH = """\
[cell]
geometry = "square"
fibre_fraction = 0.4
mesh_size = 0.06
refine = 0

[material.matrix]
young = 100.0
poisson = 0.4

[material.fibre]
young = 500.0
poisson = 0.2

[analysis]
type = "path"
plane = "stress"

[interface]
normal_strength = 4.0
tangential_strength = 3.0

[path]
strain = [0.2, 0.0, 0.05]

[output]
pictures = false
states = 8
"""
