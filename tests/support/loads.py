"""Loads of paths."""

from feti_homog.interface.loads import Load
from feti_homog.typing import Float


def strains(waypoints: Float) -> list[Load]:
    """Waypoints (n, v) that are strains."""
    return [Load.strain(each) for each in waypoints]
