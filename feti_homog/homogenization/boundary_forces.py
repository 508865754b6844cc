"""Forces that interfaces exert on the boundaries of bodies: those of their multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.nested_interiors import locks
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.states import BONDED
from feti_homog.typing import Float


def boundary_forces(
    cell: TornCell, responses: Sequence[Response], displacements: Sequence[Float], loads: Float
) -> tuple[Float, Float]:
    """(boundary dofs, k) -B^T lam, of interfaces on the nodes of bodies, and (boundary dofs,) lengths of these.

    Lengths are 0 where no tractions follow: if a phase locks, or rigid bonds end at debonded faces.  Collective.

    Of subdomains across materials those of all dofs of their parts, by the parts' `displacements` (classes, c, k) under
    the loads (v, k).
    """
    k = len(responses)
    if cell.summary.across:
        u = np.concatenate([np.zeros((0, k)), *(own.reshape(-1, k) for own in displacements)])
        solutions = [replace(r.state.solution, strain=load) for r, load in zip(responses, loads.T, strict=True)]
        lam = np.stack([cell.across_bonds(own, x)[0] for own, x in zip(solutions, u.T, strict=True)], axis=1)
        return _on_bodies(cell, cell.jumps, cell.jumps.B.T.tocsr(), lam, responses)
    lam = np.stack([response.scale * response.state.solution.lam for response in responses], axis=1)
    return _on_bodies(cell, cell.solver.jump_operator, cell.solver.interface_operators.BT, lam, responses)


def _on_bodies(
    cell: TornCell, jumps: JumpOperator, BT: csr_matrix, lam: Float, responses: Sequence[Response]
) -> tuple[Float, Float]:
    """Return forces of the multipliers (owned rows, k) on dofs, of which B^T has the rows, and lengths."""
    pairs = jumps.nodes.row[:, None] + np.arange(jumps.components)
    of_bonds, known = np.zeros(lam.shape), np.zeros((len(lam), 2))
    of_bonds[pairs] = lam[pairs]
    if _are_regular(cell, responses):
        known[pairs] = np.stack([np.ones(len(pairs)), jumps.nodes.length], axis=1)[:, None]
    # Entries of B are 1 / n where a body has n pieces at a node, each of which takes 1 / n of the force.
    squares, lengths = (BT.power(2) @ jumps.gather(known)).T
    shares = np.sqrt(np.where(squares > 0, squares, 1.0))
    return -(BT @ jumps.gather(of_bonds)) / shares[:, None], lengths / shares**2


def _are_regular(cell: TornCell, responses: Sequence[Response]) -> bool:
    """Return whether tractions are those of the faces: without tips of rigid bonds, without phases that lock."""
    nodes, state = cell.solver.jump_operator.nodes, responses[0].state
    pairs = nodes.row[:, None] + np.arange(cell.solver.jump_operator.components)
    rigid = bool(((state.solution.compliance[pairs] == 0.0).all(axis=1) & (state.status == BONDED)).any())
    has_tips = cell.comm.allreduce(rigid, MPI.LOR) and any(response.debonded for response in responses)
    return not (locks(cell.parts, cell.comm) or has_tips)
