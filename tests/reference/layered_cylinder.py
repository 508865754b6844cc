"""A cylinder of concentric layers, as a coated fibre in its matrix: states carried from layer to layer.

Layers are pairs of phase and outer radius, from within; states that stay finite at the axis begin in the first one.
"""

import numpy as np
from scipy.optimize import brentq

from reference.coated_fibre import hill, michell


def carried(layers, states_of):
    """(2 k, k) states at the outermost radius of the k fields that are finite at the axis.

    `states_of(phase, r)` (2 k, 2 k) has first these.
    """
    (core, radius), *others = layers
    states = states_of(core, radius)
    states = states[:, : len(states) // 2]
    for phase, outer in others:
        states = states_of(phase, outer) @ np.linalg.solve(states_of(phase, radius), states)
        radius = outer
    return states


def excess_energy(layers, medium):
    """Eshelby's integral of T0 u - T u0 over pi, around the layers in a medium under sigma_22 = -sigma_11 = 2 far away.

    0 is that of the medium alone.
    """
    inner, outer = carried(layers, michell), michell(medium, layers[-1][1])
    solution = np.linalg.solve(np.hstack([inner, -outer[:, 2:]]), outer[:, 0])
    state, alone = inner @ solution[:2], outer[:, 0]
    return layers[-1][1] * (alone[:2] @ state[2:] - state[:2] @ alone[2:])


def self_consistent_shear(layers, medium_of):
    """Return the shear modulus m* of the medium `medium_of(m*)` whose energy the layers do not change.

    The matrix is outside (Christensen and Lo 1979 of two layers; Herve and Zaoui 1995 of more).
    """
    scale = layers[-1][0].G_transverse
    return scale * brentq(lambda x: excess_energy(layers, medium_of(scale * x)), 1e-3, 1e3, xtol=1e-15, rtol=1e-14)


def dilute_shear(matrix, layers):
    """dG/dc of layers alone in the matrix, c their area over that of the cell.

    At the strain -e11 = e22 = 1/G of `excess_energy` 4 dG / G^2 times the cell's area is -pi times that integral.
    """
    return -(matrix.G_transverse**2) * excess_energy(layers, matrix) / (4 * layers[-1][1] ** 2)


def dilute_bulk(matrix, layers):
    """dK/dc likewise, by the pressure K_i and displacement of the layers: (K_i - K) (K + G) / (K_i + G)."""
    inner, K, G = axisymmetric_stiffness(layers)[0, 0], matrix.K_transverse, matrix.G_transverse
    return (inner - K) * (K + G) / (inner + G)


def dilute_axial_shear(matrix, layers):
    """dG_axial/dc likewise: 2 G (G_i - G) / (G_i + G)."""
    inner, G = axial_shear(layers), matrix.G_axial
    return 2 * G * (inner - G) / (inner + G)


def axisymmetric_stiffness(layers):
    """(2, 2) pressure outside and mean sigma_33, of the change of area and of the axial strain.

    u = B r + C/r with one B and C for each layer, and C = 0 in the first (Hashin and Rosen 1964, of any layers).
    """
    radii = np.array([radius for _, radius in layers])
    constants = [(*hill(phase)[:3], phase.G_transverse) for phase, _ in layers]
    count = 2 * len(layers)
    A, right = np.zeros((count, count)), np.zeros((count, 2))  # unknowns B_1, C_1, B_2, ...

    def pressure(layer, r):
        k, _, _, m = constants[layer]
        return np.array([2 * k, -2 * m / r**2])

    A[0, 1] = 1.0
    for i, r in enumerate(radii[:-1]):
        here, there = slice(2 * i, 2 * i + 2), slice(2 * i + 2, 2 * i + 4)
        A[2 * i + 1, here], A[2 * i + 1, there] = [r, 1 / r], [-r, -1 / r]
        A[2 * i + 2, here], A[2 * i + 2, there] = pressure(i, r), -pressure(i + 1, r)
        right[2 * i + 2, 1] = constants[i + 1][1] - constants[i][1]
    R = radii[-1]
    A[-1, -2:], right[-1, 0] = [1, 1 / R**2], 0.5
    amplitudes = np.linalg.solve(A, right)
    shares = np.diff(np.append(0, radii**2)) / R**2
    _, cross, along, _ = np.transpose(constants)  # Hill's k, l, n, and G
    mean = shares @ (2 * cross[:, None] * amplitudes[::2]) + [0, shares @ along]
    outside = pressure(-1, R) @ amplitudes[-2:] + [0, cross[-1]]
    return np.array([outside, mean])


def axial_shear(layers):
    """Traction over displacement at the outer radius, times that radius, both along the fibre and over cos t."""

    def states(phase, r):
        return np.array([[phase.G_axial, -phase.G_axial / r**2], [r, 1 / r]])

    traction, displacement = carried(layers, states)[:, 0]
    return traction * layers[-1][1] / displacement


def constants_of(layers):
    """K_transverse, E_axial, nu_axial and G_axial of composite cylinders of these layers."""
    (k, across), (_, along) = axisymmetric_stiffness(layers)
    return k, along - across**2 / k, across / (2 * k), axial_shear(layers)
