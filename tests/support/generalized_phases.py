"""Phases that are unlike in all directions, as tables of a case file."""

# Of different axes, so that nothing but x3 is normal to a plane of symmetry of the cell.
WOOD = {
    "E1": 12.0, "E2": 5.0, "E3": 8.0, "nu12": 0.3, "nu13": 0.25, "nu23": 0.2, "G12": 2.5, "G13": 3.1, "G23": 1.7,
    "angle": 30.0, "expansion": [40.0, 60.0, 20.0],
}  # fmt: skip
CRYSTAL = {
    "E1": 90.0, "E2": 60.0, "E3": 210.0, "nu12": 0.25, "nu13": 0.1, "nu23": 0.08, "G12": 20.0, "G13": 30.0, "G23": 11.0,
    "angle": -20.0, "expansion": [4.0, 6.0, -2.0],
}  # fmt: skip
CARBON = {
    "E_axial": 235.0, "E_transverse": 14.0, "nu_axial": 0.2, "nu_transverse": 0.25, "G_axial": 28.0,
    "expansion_axial": -0.9, "expansion_transverse": 9.0,
}  # fmt: skip
CARBON_EPOXY = {"young": 4.8, "poisson": 0.34, "expansion": 54.0}
ALUMINIUM = {"young": 68.3, "poisson": 0.3, "expansion": 23.0}
BORON = {"young": 379.3, "poisson": 0.1, "expansion": 8.1}
