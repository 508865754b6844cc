"""Effective moduli that are known exactly, from the moduli of the phases; plane strain unless stated.

Bulk modulus k = lambda + mu.  Materials are tables of the case file: young and poisson.
"""

import numpy as np


def lame(material):
    """Lame constants lambda, mu."""
    E, nu = material["young"], material["poisson"]
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def bulk_and_shear(material):
    """k, mu."""
    la, mu = lame(material)
    return la + mu, mu


def cubic(c11, c12, c33):
    """(3, 3) stiffness of square symmetry."""
    return np.array([[c11, c12, 0.0], [c12, c11, 0.0], [0.0, 0.0, c33]])


def homogeneous(material, plane):
    """(3, 3) plane stiffness by tensor algebra: invert the 3-D compliance, rotate the fourth-order tensor."""
    m = material
    if "young" in m:
        m = {f"E{i}": m["young"] for i in (1, 2, 3)} | {f"nu{i}": m["poisson"] for i in (12, 13, 23)}
        m |= {"G12": m["E1"] / (2 + 2 * m["nu12"]), "angle": 0.0}
    S = np.diag([1 / m["E1"], 1 / m["E2"], 1 / m["E3"]])
    S[0, 1] = S[1, 0] = -m["nu12"] / m["E1"]
    S[0, 2] = S[2, 0] = -m["nu13"] / m["E1"]
    S[1, 2] = S[2, 1] = -m["nu23"] / m["E2"]
    C2 = np.linalg.inv(S)[:2, :2] if plane == "strain" else np.linalg.inv(S[:2, :2])
    C = np.zeros((2, 2, 2, 2))
    for i in range(2):
        for j in range(2):
            C[i, i, j, j] = C2[i, j]
    for i, j in ((0, 1), (1, 0)):
        C[i, j, i, j] = C[i, j, j, i] = m["G12"]
    t = np.radians(m["angle"])
    Q = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
    C = np.einsum("ai,bj,ck,dl,ijkl->abcd", Q, Q, Q, Q, C)
    pairs = [(0, 0), (1, 1), (0, 1)]
    return np.array([[C[a][b] for b in pairs] for a in pairs])


def laminate(stiffnesses, fractions, across):
    """(3, 3) of strips normal to axis `across`; with a the strains and stresses that act across them,

    L_aa = <L_aa^-1>^-1, L_ab = L_aa <L_aa^-1 L_ab>, L_bb = <L_bb - L_ba L_aa^-1 L_ab> + <L_ba L_aa^-1> L_ab.
    """
    a, b = [across, 2], [1 - across]

    def mean(function):
        return sum(c * function(L) for c, L in zip(fractions, stiffnesses, strict=True))

    def soft(L):
        return np.linalg.inv(L[np.ix_(a, a)])

    aa = np.linalg.inv(mean(soft))
    ab = aa @ mean(lambda L: soft(L) @ L[np.ix_(a, b)])
    bb = mean(lambda L: L[np.ix_(b, b)] - L[np.ix_(b, a)] @ soft(L) @ L[np.ix_(a, b)])
    bb = bb + mean(lambda L: L[np.ix_(b, a)] @ soft(L)) @ ab
    result = np.empty((3, 3))
    result[np.ix_(a, a)], result[np.ix_(a, b)], result[np.ix_(b, a)], result[np.ix_(b, b)] = aa, ab, ab.T, bb
    return result


def dilute_slopes(matrix, fibre):
    """dk/dc = 1/(1/(k_f - k_m) + 1/(k_m + mu_m)), dmu/dc = 1/(1/(mu_f - mu_m) + zeta) at c = 0."""
    (k, mu), (k_f, mu_f) = bulk_and_shear(matrix), bulk_and_shear(fibre)
    return np.array([1 / (1 / (k_f - k) + 1 / (k + mu)), 1 / (1 / (mu_f - mu) + zeta(k, mu))])


def zeta(k, mu):
    """(k + 2 mu) / (2 mu (k + mu))."""
    return (k + 2 * mu) / (2 * mu * (k + mu))


def hill_bulk(bulks, mu, fractions):
    """k* of phases of one shear modulus: sum c_i / (k_i + mu) = 1 / (k* + mu), for any geometry (Hill 1964)."""
    return 1 / (fractions / (bulks + mu)).sum() - mu


def fibre_tractions(matrix, fibre):
    """p, q of a fibre in a medium under a stress s along x1: t_n = s (p + q cos 2t) / 2, t_t = -s q sin 2t / 2."""
    (k, mu), (k_f, mu_f) = bulk_and_shear(matrix), bulk_and_shear(fibre)
    ratio = mu_f / mu
    return k_f * (k + mu) / (k * (k_f + mu)), ratio / (1 + (ratio - 1) * (k + 2 * mu) / (2 * (k + mu)))


def first_slip(matrix, fibre, friction):
    """s / q and the angle in degrees at which a debonded fibre in a medium under -q + s, -q - s first slips.

    Rising in one step, t_n = -q p + s N cos 2t and t_t = -s N sin 2t, and N sin 2t + mu N cos 2t is largest at
    tan 2t = 1 / mu.
    """
    p, n = fibre_tractions(matrix, fibre)
    return friction * p / n / np.sqrt(1 + friction**2), np.degrees(np.arctan(1 / friction)) / 2


def rubbing_laminate(across, shear, friction, strain, shears):
    """S12 and the heat per area of debonded layers at the shear strains gamma12, one after the other, under E11 < 0.

    Under the stress `across` E11 the layers follow `shear` gamma12 until |S12| = mu |S11|, then slip.
    """
    most, before, stress, heat, found = -friction * across * strain, 0.0, 0.0, 0.0, []
    for gamma in shears:
        elastic = stress + shear * (gamma - before)
        stress, before = np.clip(elastic, -most, most), gamma
        heat += most * abs(elastic - stress) / shear
        found.append((stress, heat))
    return np.array(found).T


def rubbing_bond(compliance, faces, stiffness, damage, bound, shears):
    """Shear stress and heat at shears from zero, of a laminate with so many faces per length, with bonds that rub.

    Each bears (1 - d) K s + d f, f = K (s - s_i) within the bound mu p; `compliance` is that of the layers.
    """
    stress, heat, slipped, K, d = [], [0.0], 0.0, stiffness, damage
    for shear in shears:
        s = (shear + compliance * d * K * slipped) / (compliance * K + faces)
        f = K * (s - slipped)
        if abs(f) > bound:
            f = np.sign(f) * bound
            s = (shear - compliance * d * f) / (compliance * (1 - d) * K + faces)
        heat.append(heat[-1] + faces * d * f * (s - f / K - slipped))
        slipped = s - f / K
        stress.append((1 - d) * K * s + d * f)
    return np.array(stress), np.array(heat[1:])
