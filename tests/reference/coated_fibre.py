"""Boundary value problems of a round fibre, on springs or bonded, in its coat of matrix: small systems of equations.

Springs are compliances, jump over traction: (normal, tangential, axial).  The outer radius is 1, the fibre's sqrt(c).
"""

import numpy as np
from scipy.optimize import brentq

BONDED = (0.0, 0.0, 0.0)


def michell(phase, r):
    """(4, 4) rows sigma_rr, tau, u_r, u_t over cos 2t, sin 2t, cos 2t, sin 2t of stress functions.

    The functions are (r^2, r^4, r^-2, 1) cos 2t in plane strain (Michell; Timoshenko and Goodier).
    """
    m, kappa = phase.G_transverse, 1 + 2 * phase.G_transverse / phase.K_transverse
    return np.array([
        [-2, 0, -6 / r**4, -4 / r**2],
        [2, 6 * r**2, -6 / r**4, -2 / r**2],
        [-r / m, (kappa - 3) * r**3 / (2 * m), 1 / (m * r**3), (kappa + 1) / (2 * m * r)],
        [r / m, (kappa + 3) * r**3 / (2 * m), 1 / (m * r**3), -(kappa - 1) / (2 * m * r)],
    ])  # fmt: skip


def across_springs(springs):
    """Tractions and displacements outside of an interface from those inside."""
    jump = np.eye(4)
    jump[2, 0], jump[3, 1] = springs[:2]
    return jump


def excess_energy(matrix, fibre, c, medium, springs=BONDED):
    """Eshelby's integral of T0 u - T u0 around a coated fibre in a medium, 0 that of the medium alone, in shear."""
    a = np.sqrt(c)
    through = np.linalg.solve(michell(matrix, a), across_springs(springs) @ michell(fibre, a)[:, :2])
    inner, outer = michell(matrix, 1.0) @ through, michell(medium, 1.0)
    solution = np.linalg.solve(np.hstack([inner, -outer[:, 2:]]), outer[:, 0])
    state, alone = inner @ solution[:2], outer[:, 0]
    return alone[:2] @ state[2:] - state[:2] @ alone[2:]


def self_consistent_shear(matrix, fibre, c, medium_of, springs=BONDED):
    """Return the root m* of `excess_energy` of the medium `medium_of(m*)`."""
    scale = matrix.G_transverse
    return scale * brentq(
        lambda x: excess_energy(matrix, fibre, c, medium_of(scale * x), springs), 1e-3, 1e3, xtol=1e-15, rtol=1e-14
    )


def shear_of_fibre(matrix, fibre, a, springs):
    """Mean shear stress over twice the mean strain, jumps included, of a fibre of radius a alone in the matrix."""
    inner, outer = across_springs(springs) @ michell(fibre, a)[:, :2], michell(matrix, a)
    radial, shear, opening, slip = inner @ np.linalg.solve(np.hstack([inner, -outer[:, 2:]]), outer[:, 0])[:2]
    return a * (radial - shear) / (opening - slip) / 2


def axisymmetric_stiffness(matrix, fibre, c, springs=BONDED):
    """(2, 3): pressure outside and mean sigma_33, of the change of area, the axial strain and the temperature."""
    a, (kf, lf, nf, bf, gf), (km, lm, nm, bm, gm) = np.sqrt(c), hill(fibre), hill(matrix)
    shear, columns = 2 * matrix.G_transverse / c, []
    for area, length, heat in np.eye(3):
        # u = A r in the fibre, B r + C/r in the matrix: traction, jump and the radius outside
        A, B, C = np.linalg.solve(
            [[2 * kf, -2 * km, shear], [-a - 2 * kf * springs[0], a, 1 / a], [0, 1, 1]],
            [(lm - lf) * length - (bm - bf) * heat, springs[0] * (lf * length - bf * heat), area / 2],
        )
        pressure = 2 * km * B - 2 * matrix.G_transverse * C + lm * length - bm * heat
        in_fibre, in_matrix = 2 * lf * A + nf * length - gf * heat, 2 * lm * B + nm * length - gm * heat
        columns.append([pressure, c * in_fibre + (1 - c) * in_matrix])
    return np.transpose(columns)


def axial_shear(matrix, fibre, c, springs=BONDED):
    """Traction over displacement at the outer radius, both along the fibre and over cos t."""
    a, pf, pm = np.sqrt(c), fibre.G_axial, matrix.G_axial
    _, B, C = np.linalg.solve([[pf, -pm, pm / c], [-a - springs[2] * pf, a, 1 / a], [0, 1, 1]], [0.0, 0.0, 1.0])
    return pm * (B - C)


def hill(phase):
    """k, l, n from the stiffness, and the stresses per kelvin that hold it: b across, g along."""
    S = np.diag([1 / phase.E_transverse] * 2 + [1 / phase.E_axial])
    S[0, 1] = S[1, 0] = -phase.nu_transverse / phase.E_transverse
    S[:2, 2] = S[2, :2] = -phase.nu_axial / phase.E_axial
    C = np.linalg.inv(S)
    strains = [phase.expansion_transverse, phase.expansion_transverse, phase.expansion_axial]
    heat = C @ [0.0 if strain is None else strain for strain in strains]
    return (C[0, 0] + C[0, 1]) / 2, C[0, 2], C[2, 2], heat[0], heat[2]


def tractions_of_fibre(matrix, fibre, radius, springs):
    """p0, N and T of a fibre alone in the matrix.

    t_n = s p0 + d N cos 2t and t_t = d T sin 2t under the far stresses s11 = s + d and s22 = s - d.
    """
    (normal, tangential), stiff, soft = springs, 2 * fibre.K_transverse, 2 * matrix.K_transverse
    # u = p r / stiff in the fibre, r / soft + C / r in the matrix, where the radial stress is 1 - 2 m C / r^2.
    m = 2 * matrix.G_transverse / radius**2
    p0 = (radius / soft + 1 / (m * radius)) / (1 / normal + radius / stiff + 1 / (m * radius))
    inner = across_springs((1 / normal, 1 / tangential)) @ michell(fibre, radius)[:, :2]
    outer = michell(matrix, radius)
    N, T, *_ = inner @ np.linalg.solve(np.hstack([inner, -outer[:, 2:]]), -0.5 * outer[:, 0])[:2]
    return p0, N, T


def onset_of_fibre(matrix, fibre, radius, springs, toughness, sensitivity, far):
    """Compute the factor of the far stresses (2,) at which the first bond breaks by the energy of its springs."""
    p0, N, T = tractions_of_fibre(matrix, fibre, radius, springs)
    (s, d), t = (far[0] + far[1], far[0] - far[1]), np.radians(np.linspace(0.0, 90.0, 9001))
    normal, tangential = (s * p0 + d * N * np.cos(2 * t)) / 2, d * T * np.sin(2 * t) / 2
    opening, sliding = np.maximum(normal, 0.0) ** 2 / (2 * springs[0]), tangential**2 / (2 * springs[1])
    mode = 1 + np.tan((1 - sensitivity) * np.arctan2(np.sqrt(sliding), np.sqrt(opening))) ** 2
    return 1 / np.sqrt(((opening + sliding) / (toughness * mode)).max())
