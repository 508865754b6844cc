"""The keys whose values decide which other keys belong to a case."""

from __future__ import annotations

from feti_homog.case.bond_laws import laws_with
from feti_homog.schema.keys import Selector

ANALYSIS_TYPE = Selector("analysis", "type")
PLANE = Selector("analysis", "plane")
METHOD = Selector("path", "method")
CRITERION = Selector("interface", "criterion", word="law")

ANGLE_ANALYSIS, PATH_ANALYSIS = ANALYSIS_TYPE.among("angle"), ANALYSIS_TYPE.among("path")
LOAD_ANALYSIS = ANALYSIS_TYPE.among("load")
ENVELOPE_ANALYSIS, BREAKING = ANALYSIS_TYPE.among("envelope"), ANALYSIS_TYPE.among("path", "envelope")
BY_ENERGY, BY_STRENGTH, BY_AXIAL_STRENGTH, SOFTENING, BY_TABLE = (
    CRITERION.among(*laws_with(key))
    for key in ("toughness", "normal_strength", "axial_strength", "mixing_exponent", "openings")
)

IN_THE_PLANE, GENERALIZED = PLANE.among("strain", "stress"), PLANE.among("generalized")
BY_EVENTS, BY_INCREMENTS = METHOD.among("events"), METHOD.among("increments")
