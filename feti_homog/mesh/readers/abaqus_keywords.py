"""Split an Abaqus input file into keyword blocks, and recognize the keywords that make a mesh."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from feti_homog.errors import MeshError
from feti_homog.schema import wording

# Keywords that the reader uses, and the allowed parameters; None allows any parameters.
READ: dict[str, tuple[str, ...] | None] = {
    "NODE": ("NSET", "SYSTEM"),
    "ELEMENT": ("TYPE", "ELSET"),
    "ELSET": ("ELSET", "GENERATE", "INTERNAL", "INSTANCE", "UNSORTED"),
    **dict.fromkeys(("SOLID SECTION", "SHELL SECTION", "MEMBRANE SECTION")),
    **dict.fromkeys(("PART", "END PART", "INSTANCE", "END INSTANCE", "ASSEMBLY", "END ASSEMBLY")),
}
OF_SECTIONS = ("ELSET", "MATERIAL")
# Keywords that make or move nodes and elements, and the reason for the refusal.
GENERATORS = (
    "SYSTEM", "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "IMPERFECTION", "IMPORT", "PARAMETER",
    "SYMMETRIC MODEL GENERATION", "SUBSTRUCTURE GENERATE", "USER ELEMENT", "REFINE MESH", "MODEL CHANGE",
)  # fmt: skip
REFUSED = dict.fromkeys(GENERATORS, "it makes or moves nodes or elements, and is not read: write them out")
REFUSED["INCLUDE"] = "other files are not read: expected all in one file"
WHOLE = {name.replace(" ", ""): name for name in (*READ, *REFUSED)}
# Beginnings, without blanks, of keywords that make no nodes or elements.
BEGINNINGS = """
ACOUSTIC ADAPTIVE ADJUST AMPLITUDE ANISOTROPIC ANNEAL AQUA BASELINE BASEMOTION BEAM BIAXIAL BOND BOUNDARY BRITTLE
BUCKL BULKVISCOSITY CADDEDMASS CAP CASTIRON CAVITY CECHARGE CECURRENT CENTROID CFILM CFLOW CFLUX CHANGEFRICTION CLAY
CLEARANCE CLOAD CO-SIMULATION COHESIVE COMBINEDTEST COMPLEX COMPOSITEMODAL CONCRETE CONDUCTIVITY CONNECTOR CONSTRAINT
CONTACT CONTOUR CONTROLS CORRELATION COUPLE COUPLING CRADIATE CREEP CRUSHABLE CYCLED CYCLIC DADDEDMASS DAMAGE DAMPING
DASHPOT DEBOND DECHARGE DECURRENT DEFORMATIONPLASTICITY DENSITY DEPVAR DESIGN DETONATION DFLOW DFLUX DIAGNOSTICS
DIELECTRIC DIFFUSIVITY DIRECTCYCLIC DISPLAYBODY DISTRIBUTING DISTRIBUTION DLOAD DRAG DRUCKER DSA DSF DSLOAD DYNAMIC
ELASTIC ELECTR ELEMENTMATRIX ELEMENTOUTPUT ELEMENTRESPONSE ELFILE ELPRINT EMBEDDED EMISSIVITY ENDLOAD ENDSTEP ENERGY
ENRICHMENT EOS EPJOINT EQUATION EULERIAN EXPANSION EXTERNAL EXTREME FABRIC FACEPRINT FAIL FASTENER FIELD FILE FILM
FILTER FIXEDMASS FLOW FLUID FLUX FOUNDATION FRACTURE FRAMESECTION FREQUENCY FRICTION GAP GAS GEL GEOSTATIC
GLOBALDAMPING HEADING HEAT HOURGLASS HYPERELASTIC HYPERFOAM HYPOELASTIC HYSTERESIS IMPEDANCE INCIDENT INCREMENTATION
INELASTIC INERTIA INITIAL INTEGRATED INTERFACE JOINT JOULE KAPPA KINEMATIC LATENT LOADCASE LOADING LOWDENSITY MAGNETIC
MASS MATERIAL MEDIA MODAL MOHR MOISTURE MOLECULAR MONITOR MOTION MPC MULLINS NETWORKMPC NOCOMPRESSION NODAL NODEFILE
NODEOUTPUT NODEPRINT NODERESPONSE NONLINEAR NONSTRUCT NORMAL NOTENSION NSET OBJECTIVE ORIENTATION ORNL OUTPUT PARTICLE
PERIODICMEDIA PERMANENT PERMEABILITY PHYSICAL PIEZO PLANARTEST PLASTIC PML POROUS POSTOUTPUT POTENTIAL PRE-TENSION
PREPRINT PRESSURE PRESTRESS PRINT PSD RADIATE RADIATION RANDOM RATE RATIOS REBAR RELEASE RESPONSE RESTART RETAINED
RIGID ROTARY SECTION SELECT SENSITIVITY SFILM SFLOW SHEAR SHELLGENERAL SHELLTOSOLID SIMPEDANCE SIMPLESHEAR SLIDELINE
SLOAD SOILS SOLUBILITY SOLUTION SOLVER SORPTION SPECIFIC SPECTRUM SPRING SRADIATE STATIC STEADYSTATE STEP SUBCYCLING
SUBMODEL SURFACE SWELLING TEMPERATURE TENSILE TENSION THERMAL TIE TIME TORQUE TRACER TRANSFORM TRANSPORT TRIAXIAL TRS
UELPROPERTY UNCOUPLED UNDEX UNIAXIAL UNLOADING USERDEFINED USERMATERIAL USEROUTPUT VALUESATINFINITY VIEWFACTOR VISCO
VOIDNUCLEATION VOLUMETRIC WAVE WIND
"""
OTHERS = tuple(BEGINNINGS.split())


@dataclass
class KeywordBlock:
    """A keyword line and the data lines below.

    Attributes:
        number: number of the keyword line, from 1.
        word: the keyword as in the file.
        keyword: the keyword in full; empty for keywords that make no nodes or elements.
        parameters: parameter values by parameter names in upper case.
        rows: the words of each data line.
    """

    number: int
    word: str
    keyword: str
    parameters: dict[str, str]
    rows: list[list[str]] = field(default_factory=list)

    @classmethod
    def begun(cls, number: int, line: str) -> KeywordBlock:
        """Begin a block with the keyword and parameters of a keyword line.

        For example, *ELEMENT, TYPE=CPE3 has the keyword ELEMENT and the parameter TYPE.

        Raises:
            MeshError: the keyword is unknown or ambiguous, or a mesh keyword has a parameter that is not in READ.
        """
        word, *rest = (part.strip() for part in line[1:].split(","))
        try:
            keyword = resolved(word)
        except ValueError as error:
            raise MeshError(f"line {number}, *{word}: {error}") from None
        names = OF_SECTIONS if keyword.endswith("SECTION") else READ.get(keyword) or ()
        parameters = {}
        for part in filter(None, rest):
            name, _, value = part.partition("=")
            name = name.strip().upper()
            longer = [full for full in names if full.startswith(name)]
            parameters[longer[0] if len(longer) == 1 and name not in names else name] = name_of(value)
        if READ.get(keyword) and (unread := [name for name in parameters if name not in names]):
            fault = f"its parameter {wording.toml_value(unread[0])} is not read"
            raise MeshError(f"line {number}, *{word}: {fault}: write nodes and elements out without it")
        return cls(number, word, keyword, parameters)

    def parameter(self, name: str) -> str:
        """Return the value of the parameter `name`; ValueError if the block lacks it."""
        if name not in self.parameters:
            raise ValueError(f"no {name}")
        return self.parameters[name]


def blocks(text: str) -> Iterator[KeywordBlock]:
    """Yield the keyword blocks of the `text` of a file.

    Raises:
        MeshError: as in `KeywordBlock.begun`, or data precede the first keyword.
    """
    block, open_line = None, ""
    for number, line in enumerate(map(str.strip, text.splitlines()), start=1):
        if not line or line.startswith("**"):
            continue
        if line.startswith("*"):
            if block is not None:
                yield block
            block, open_line = KeywordBlock.begun(number, line), line
        elif block is None:
            raise MeshError(f"line {number}: data without a keyword: expected *NODE, *ELEMENT, ... before")
        elif open_line.endswith(","):
            open_line += line
            block = KeywordBlock.begun(block.number, open_line)
        else:
            open_line = ""
            block.rows.append([word.strip() for word in line.rstrip(", \t").split(",")])
    if block is not None:
        yield block


def resolved(word: str) -> str:
    """Complete an abbreviated keyword; return "" for keywords that make no nodes or elements.

    Blanks and capitals do not matter. An abbreviation is valid if it is the beginning of only one keyword.

    Raises:
        ValueError: the word begins no keyword, or several keywords.
    """
    key = re.sub(r"\s", "", word.upper())
    if key in WHOLE or key.startswith(OTHERS):
        return WHOLE.get(key, "")
    # *ELEM is *ELEMENT, although *ELEMENT OUTPUT has the same beginning.
    longer = {name for name in (*WHOLE, *OTHERS) if key and name.startswith(key)}
    keywords = {WHOLE.get(name, "") for name in longer if not any(map(name.startswith, longer - {name}))}
    if len(keywords) != 1:
        fault = "may be several keywords" if keywords else "unknown keyword"
        raise ValueError(f"{fault}: write it out, or delete it if it makes no nodes or elements")
    return keywords.pop()


def name_of(word: str) -> str:
    """Convert a name to lower case, or strip the quotation marks of a quoted name."""
    word = word.strip()
    return word[1:-1] if word[:1] == '"' else word.lower()
