"""Readers of material cards, from the formats' manuals: the (3, 3, 3, 3) stiffness and (3, 3) expansion of a card."""

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from feti_homog.typing import Float
from support.effective_results import PAIRS, tensor_of_stiffness

Card = tuple[Float, Float | None]

CONSTANTS = "E1 E2 E3 nu12 nu13 nu23 G12 G13 G23"
ABAQUS_ENTRIES = (
    "1111 1122 2222 1133 2233 3333 1112 2212 3312 1212 1113 2213 3313 1213 1313 1123 2223 3323 1223 1323 2323"
)
MOOSE_ENTRIES = {
    "symmetric9": "1111 1122 1133 2222 2233 3333 2323 1313 1212",
    "symmetric21": (
        "1111 1122 1133 1123 1113 1112 2222 2233 2223 2213 2212 3333 3323 3313 3312 2323 2313 2312 1313 1312 1212"
    ),
}
ANSYS_TERMS = "D11 D21 D31 D41 D51 D61 D22 D32 D42 D52 D62 D33 D43 D53 D63 D44 D54 D64 D55 D65 D66"
ANSYS_PAIRS = {"1": "11", "2": "22", "3": "33", "4": "12", "5": "23", "6": "13"}


def read_calculix(text: str) -> Card:
    """Read a card whose shears of *EXPANSION, TYPE=ANISO are the tensor's."""
    blocks: dict[str, list[float]] = {}
    for line in text.splitlines():
        assert line.isascii() and len(line) <= 256
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            values = blocks.setdefault(line, [])
        else:
            fields = line.split(",")
            assert len(fields) <= 8 and all(len(field.strip()) <= 20 for field in fields)
            values += map(float, fields)
    kind = next(line for line in blocks if line.startswith("*ELASTIC")).partition("TYPE=")[2]
    values = blocks[f"*ELASTIC, TYPE={kind}"]
    if kind == "ENGINEERING CONSTANTS":
        C = stiffness_of_constants(dict(zip(CONSTANTS.split(), values, strict=True)))
    else:
        C = filled(ABAQUS_ENTRIES, values)
    if "*EXPANSION, TYPE=ANISO" in blocks:
        a11, a22, a33, a12, a13, a23 = blocks["*EXPANSION, TYPE=ANISO"]
        return C, np.array([[a11, a12, a13], [a12, a22, a23], [a13, a23, a33]])
    return C, np.diag(blocks["*EXPANSION, TYPE=ORTHO"]) if "*EXPANSION, TYPE=ORTHO" in blocks else None


def read_abaqus(text: str) -> Card:
    """As for CalculiX, but Abaqus stores strains, thermal ones too, with engineering shears."""
    C, alpha = read_calculix(text)
    if alpha is not None:
        alpha = np.diag(np.diag(alpha)) + (alpha - np.diag(np.diag(alpha))) / 2
    return C, alpha


def read_ansys(text: str) -> Card:
    commands = [line.split(",") for line in text.splitlines() if not line.startswith("!")]
    constants = {words[1]: float(words[3]) for words in commands if words[0] == "MP"}
    terms = {int(words[1]) + k: float(word) for words in commands if words[0] == "TBDATA"
             for k, word in enumerate(words[2:])}  # fmt: skip
    if terms:
        assert ["TB", "ANEL", "1", "1", "21", "0"] in commands and sorted(terms) == list(range(1, 22))
        names = [ANSYS_PAIRS[term[1]] + ANSYS_PAIRS[term[2]] for term in ANSYS_TERMS.split()]
        C = filled(" ".join(names), [terms[k] for k in range(1, 22)])
    else:
        labels = {"E1": "EX", "E2": "EY", "E3": "EZ", "nu12": "PRXY", "nu13": "PRXZ", "nu23": "PRYZ",
                  "G12": "GXY", "G13": "GXZ", "G23": "GYZ"}  # fmt: skip
        C = stiffness_of_constants({name: constants[label] for name, label in labels.items()})
    given = [constants[label] for label in ("ALPX", "ALPY", "ALPZ") if label in constants]
    return C, np.diag(given) if given else None


def read_moose(text: str) -> Card:
    blocks: dict[str, dict[str, str]] = {}
    name = ""
    for line in text.splitlines():
        if opened := re.fullmatch(r" *\[(\w+)\]", line):
            name = opened[1]
        elif entry := re.fullmatch(r" +(\w+) = (.+)", line):
            blocks.setdefault(name, {})[entry[1]] = entry[2].strip("'")
    assert text.count("[]") == len(blocks) + 1
    of_type = {block["type"]: block for block in blocks.values()}
    elasticity = of_type["ComputeElasticityTensor"]
    C = filled(MOOSE_ENTRIES[elasticity["fill_method"]], [float(word) for word in elasticity["C_ijkl"].split()])
    if "ComputeEigenstrain" not in of_type:
        return C, None
    eigenstrain, rise = of_type["ComputeEigenstrain"], of_type["ParsedMaterial"]
    assert eigenstrain["prefactor"] == rise["property_name"]
    assert rise["expression"] == f"{rise['coupled_variables']} - {rise['constant_names']}"
    a11, a22, a33, a23, a13, a12 = map(float, eigenstrain["eigen_base"].split())
    return C, np.array([[a11, a12, a13], [a12, a22, a23], [a13, a23, a33]])


def read_csv(text: str) -> Card:
    """From the entries of the stiffness; that the engineering constants are the same has its own test."""
    rows = {row["name"]: float(row["value"]) for row in csv.DictReader(io.StringIO(text))}
    C = np.array([[rows[f"C{min(i, j)}{max(i, j)}"] for j in range(1, 7)] for i in range(1, 7)])
    if "expansion_axial" not in rows:
        return tensor_of_stiffness(C), None
    alpha = np.diag([rows[f"expansion_{axis}"] for axis in ("axial", "x1", "x2")])
    for i, j in PAIRS[3:]:
        alpha[i, j] = alpha[j, i] = rows[f"expansion_gamma{i + 1}{j + 1}"] / 2
    return tensor_of_stiffness(C), alpha


READERS: dict[str, Callable[[str], Card]] = {
    "abaqus": read_abaqus, "calculix": read_calculix, "ansys": read_ansys, "moose": read_moose, "csv": read_csv,
}  # fmt: skip


def filled(entries: str, values: Sequence[float]) -> Float:
    """Return the tensor of C_ijkl, "1123" and the like, and of those that are the same by symmetry."""
    C = np.zeros((3, 3, 3, 3))
    for word, value in zip(entries.split(), values, strict=True):
        i, j, k, m = (int(digit) - 1 for digit in word)
        for p, q in ((i, j), (j, i)):
            for r, s in ((k, m), (m, k)):
                C[p, q, r, s] = C[r, s, p, q] = value
    return C


def stiffness_of_constants(constants: Mapping[str, float]) -> Float:
    """nu_ij = -eps_j/eps_i under stress along i."""
    S = np.zeros((6, 6))
    for k in range(3):
        S[k, k] = 1 / constants[f"E{k + 1}"]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        S[i, j] = S[j, i] = -constants[f"nu{i + 1}{j + 1}"] / constants[f"E{i + 1}"]
    for k in (3, 4, 5):
        i, j = PAIRS[k]
        S[k, k] = 1 / constants[f"G{i + 1}{j + 1}"]
    return tensor_of_stiffness(np.linalg.inv(S))
