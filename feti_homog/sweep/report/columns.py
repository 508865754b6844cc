"""What the tables of a sweep hold: the columns of sweep.csv and the datasets of sweep.h5, with unit and meaning.

In names, i and j stand for 1, 2 or 3, in stiffnesses of generalized plane strain for 1 to 6, and words in capitals for
what varies between sweeps.  If cases of a sweep are in generalized plane strain and others in a plane state, i and j of
these are 1, 2 or 6, so that Cij is the same entry of all: the shear modulus in the plane is C66.
"""

from __future__ import annotations

from feti_homog.materials.bounds import Moduli
from feti_homog.materials.spatial_constants import EngineeringConstants, TransverselyIsotropic
from feti_homog.results.csv_tables import Column, columns
from feti_homog.runtime.records import STRESS

CASE_COLUMNS = (
    Column("row", "", "`case`, or of a point the `count`, `mean`, `std` and `ci95` of its realisations"),
    Column("folder", "", "folder of the case, in that of the sweep"),
    Column("point", "", "number of the point, from 1"),
    Column("realisation", "", "number of the realisation of the point, from 1"),
    Column("status", "", "`done`, `not converged`, `failed`, `damaged`, `running` or `waiting`"),
    Column("reason", "", "why there is no result"),
)
INPUT_COLUMNS = (Column("SECTION.KEY", "that of the key", "value of a key that varies"),)
MODULI = {column.name for column in columns(Moduli)}
OUTPUT_COLUMNS = (
    Column("fraction_meshed", "", "share of all fibres in the meshed area"),
    Column("fraction_PHASE", "", "share of a phase in the meshed area, if there are more than matrix and fibre"),
    Column("porosity", "", "share of voids in the area of the cell, where there are some"),
    Column("match_distance", "", "of cells with `match`: how far they are from the table, in mean diameters"),
    Column("elements", "", "triangles of the refined mesh"),
    Column("nodes", "", "nodes of the refined mesh, those on cuts once for each subdomain"),
    Column("ranks", "", "MPI ranks"),
    Column("subdomains", "", "subdomains that the bodies are cut into"),
    Column("dofs", "", "degrees of freedom of all subdomains"),
    Column("multipliers", "", "Lagrange multipliers of the dual problem"),
    Column("iterations", "", "Krylov iterations of all states"),
    Column("Cij", STRESS, "entry of L^ef; beside generalized plane strain C66 is the shear modulus of all"),
    Column("Cij_compression", STRESS, "the same under minus the unit strains, with contact"),
    Column("thermal_Sij", f"{STRESS} per unit of temperature", "stress per unit of temperature at no strain"),
    Column("expansion_STRAIN", "1 / temperature", "strain per unit of temperature at no stress"),
    Column("anisotropy_axial", STRESS, "C11 - C22"),
    Column("anisotropy_shear", STRESS, "C33 - (C11 + C22 - 2 C12) / 4; with generalized plane strain C66 - ..."),
    *columns(Moduli),
    *(column for column in columns(EngineeringConstants) if column.name not in MODULI),
    *columns(TransverselyIsotropic),
    Column("Cii_reuss", STRESS, "lower bound of Cii"),
    Column("Cii_voigt", STRESS, "upper bound of Cii"),
    Column("bulk_lower", STRESS, "lower bound of bulk, by Hashin and Shtrikman"),
    Column("bulk_upper", STRESS, "upper bound of bulk, by Hashin and Shtrikman"),
    Column("shear_lower", STRESS, "lower bound of shear, by Hashin and Shtrikman"),
    Column("shear_upper", STRESS, "upper bound of shear, by Hashin and Shtrikman"),
    Column("angle_ANGLE_Cij", STRESS, "entry of L^ef at an opening of that many degrees"),
    Column("angle_ANGLE_Sij", STRESS, "macroscopic stress at an opening of that many degrees"),
    Column("onset_load_factor", "", "load factor of the first point of a path"),
    Column("dissipated", STRESS, "energy lost to all breaks of a path, per area of the cell"),
    Column("work", STRESS, "work of the loads along a path, per area of the cell"),
    Column("onset_Sij", STRESS, "macroscopic stress at the first point of a path"),
    Column("onset_STRAIN", "", "macroscopic strain at the first point of a path"),
    Column("peak_Sij", STRESS, "largest in magnitude of a path, with its sign"),
    Column("end_Sij", STRESS, "macroscopic stress at the end of a path"),
    Column("end_STRAIN", "", "macroscopic strain at the end of a path"),
    Column("end_STATUS", "", "interface nodes that are bonded, open or closed at the end of a path"),
    Column("load_STRAIN", "", "macroscopic strain under the load of analysis `load`"),
    Column("load_Sij", STRESS, "macroscopic stress under it"),
    Column("load_stored", STRESS, "elastic energy stored under it, per area of the cell"),
    Column("load_STATUS", "", "interface nodes that are bonded, open or closed under it"),
    Column("envelope_AXIS", "that of the axis", "load at onset along the first axis of an envelope"),
    Column("envelope_least_AXIS_AXIS", "that of the axes", "least load at onset of all directions"),
    Column("envelope_largest_AXIS_AXIS", "that of the axes", "largest, if every direction has one"),
    Column("check_LAW", "", "largest relative error of a law, as in result.json"),
    Column("seconds_STAGE", "s", "wall time of a stage, the largest over ranks"),
    Column("memory", "bytes", "peak resident memory, the largest over ranks"),
)
COLUMNS = (*CASE_COLUMNS, *INPUT_COLUMNS, *OUTPUT_COLUMNS)

DATASETS = (
    Column("/cases/COLUMN", "", "`folder`, `point`, `realisation`, `status`, `reason` of each case"),
    Column("/inputs/SECTION.KEY", "that of the key", "of each case"),
    Column("/outputs/COLUMN", "that of the column", "of each case, NaN where there is none"),
    Column("/points/number", "", "the points"),
    Column("/points/SECTION.KEY", "that of the key", "of each point"),
    Column("/statistics/PART/COLUMN", "that of the column", "`count`, `mean`, `std`, `ci95` of each point"),
    Column("/curves/point-K/strain", "", "strains at which the straight paths of a point are compared"),
    Column("/curves/point-K/Sij", STRESS, "stresses there, a row for each realisation"),
    Column("/curves/point-K/Sij_PART", STRESS, "`mean`, `std`, `ci95` of these"),
)
