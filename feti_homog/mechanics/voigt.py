"""The names of the components in Voigt order [11, 22, 12], with engineering shear strain."""

STRAINS = ("E11", "E22", "gamma12")
STRESSES = ("S11", "S22", "S12")
STIFFNESSES = tuple(f"C{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
