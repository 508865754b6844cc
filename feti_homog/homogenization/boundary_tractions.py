"""Tractions that are known on the boundaries of subdomains: those of the multipliers of interfaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.nested_interiors import locks
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.states import BONDED
from feti_homog.typing import Bool, Float


def boundary_tractions(cell: TornCell, responses: Sequence[Response]) -> tuple[Float, Bool]:
    """(boundary dofs, k) -B^T lam / length, the tractions of interfaces on bodies, and (boundary dofs,) where known.

    Nowhere if a phase locks, or if rigid bonds end at debonded faces, where they are singular.  Collective.
    """
    jumps, boundary = cell.solver.jump_operator, cell.solver.interface_operators
    pairs = jumps.nodes.row[:, None] + np.arange(jumps.components)
    lam, known = np.zeros((cell.solver.rows, len(responses))), np.zeros((cell.solver.rows, 1))
    for k, response in enumerate(responses):
        lam[pairs, k] = response.scale * response.state.solution.lam[pairs] / jumps.nodes.length[:, None]
    if _are_regular(cell, responses):
        known[pairs] = 1.0
    # Entries of B are 1 / n where a body has n pieces at a node, each of which takes 1 / n of the force.
    shares = np.sqrt(boundary.BT.power(2) @ jumps.gather(known)[:, 0])
    is_known = shares > 0
    return -(boundary.BT @ jumps.gather(lam)) / np.where(is_known, shares, 1.0)[:, None], is_known


def _are_regular(cell: TornCell, responses: Sequence[Response]) -> bool:
    """Return whether tractions are those of the faces: without tips of rigid bonds, without phases that lock."""
    nodes, state = cell.solver.jump_operator.nodes, responses[0].state
    pairs = nodes.row[:, None] + np.arange(cell.solver.jump_operator.components)
    rigid = bool(((state.solution.compliance[pairs] == 0.0).all(axis=1) & (state.status == BONDED)).any())
    has_tips = cell.comm.allreduce(rigid, MPI.LOR) and any(response.debonded for response in responses)
    return not (locks(cell.subdomains, cell.comm) or has_tips)
