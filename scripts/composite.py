"""Parts that the scripts' cases share: the composite of Eq. (38), in GPa, its stiffness without files of fields."""

MATERIAL = {"matrix": {"young": 88.0, "poisson": 0.299}, "fibre": {"young": 200.0, "poisson": 0.222}}
STIFFNESS = {
    "material": MATERIAL,
    "analysis": {"type": "stiffness", "plane": "strain"},
    "output": {"fields": False, "pictures": False},
}
