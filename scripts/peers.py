"""The peers of the benchmarks: each solver is a KSP of PETSc, defined by its options alone."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Peer:
    """A solver of the glued cell.

    Attributes:
        options: of PETSc, without prefix.
        note: remark for readers of its numbers.
        matrix: type of its matrix.
        sequential: whether it runs on one rank only.
        direct: whether its solution is exact to rounding.
        rigid: whether it gets the rigid-body modes.
    """

    options: dict[str, str]
    note: str
    matrix: str = "aij"
    sequential: bool = False
    direct: bool = False
    rigid: bool = False


def _bddc(prefix: str) -> dict[str, str]:
    """Return the options without which PCBDDC fails or needs several times the iterations on these cells.

    The rotation as a near-null vector costs more than it saves on 2 ranks.
    """
    names = {
        "detect_disconnected": "true",  # a rank's subdomains need not touch
        "use_change_of_basis": "true",  # a rank's share of the torus floats: it may have no primal vertex
        "use_deluxe_scaling": "true",
        "deluxe_singlemat": "true",
    }
    for solver in ("dirichlet", "neumann"):
        names |= {f"{solver}_pc_type": "cholesky", f"{solver}_pc_factor_mat_solver_type": "mumps"}
    return {f"{prefix}pc_bddc_{name}": value for name, value in names.items()}


_CG = {"ksp_type": "cg", "ksp_norm_type": "unpreconditioned"}
_DIRECT = {"ksp_type": "preonly", "pc_type": "cholesky"}
_ONE_A_RANK = "MATIS holds one subdomain a rank: those of a rank are glued; deluxe scaling, change of basis"

PEERS = {
    "cholmod": Peer(
        _DIRECT | {"pc_factor_mat_solver_type": "cholmod"}, "sequential: one rank", sequential=True, direct=True
    ),
    "mumps": Peer(_DIRECT | {"pc_factor_mat_solver_type": "mumps"}, "", direct=True),
    "gamg": Peer(
        _CG | {"pc_type": "gamg", "pc_gamg_threshold": "0.05"},
        "CG; smoothed aggregation on the rigid-body modes",
        rigid=True,
    ),
    "hypre": Peer(_CG | {"pc_type": "hypre"}, "CG; BoomerAMG by unknowns, which has no use for rigid-body modes"),
    "hypre_rigid": Peer(
        _CG
        | {
            "pc_type": "hypre",
            "pc_hypre_boomeramg_nodal_coarsen": "4",
            "pc_hypre_boomeramg_vec_interp_variant": "2",
        },
        "CG; BoomerAMG by nodes, interpolating the rigid-body modes",
        rigid=True,
    ),
    "fetidp": Peer(
        {"ksp_type": "fetidp", "fetidp_ksp_type": "cg"} | _bddc("fetidp_bddc_"), f"KSPFETIDP; {_ONE_A_RANK}", "is"
    ),
    "bddc": Peer(_CG | {"pc_type": "bddc"} | _bddc(""), f"CG and PCBDDC; {_ONE_A_RANK}", "is"),
}
