"""Shared parts of the scripts' cases: the composite of Eq. (38), in GPa, and its stiffness without field files."""

MATERIAL = {"matrix": {"young": 88.0, "poisson": 0.299}, "fibre": {"young": 200.0, "poisson": 0.222}}
STIFFNESS = {
    "material": MATERIAL,
    "analysis": {"type": "stiffness", "plane": "strain"},
    "output": {"fields": False, "pictures": False},
}
