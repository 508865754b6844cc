"""Laws of long fibres in space that are known exactly, from the tables of materials of a case file.

Voigt order [11, 22, 33, 23, 13, 12] with engineering shears; x3 is the axis of the fibres.
"""

import numpy as np
from scipy.special import comb

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
IN_PLANE = [0, 1, 5]
COUPLED = [0, 1, 2, 5]  # with each other, where x3 is normal to a plane of symmetry
ONES = np.array([1.0, 1, 1, 0, 0, 0])


def law(material):
    """Stiffness (6, 6) and expansion (6,), or None, in the axes of the cell."""
    m = dict(material)
    if "stiffness" in m:
        return np.array(m["stiffness"], float), expansion_in_axes(m)
    if "young" in m:
        m |= {f"E{i}": m["young"] for i in (1, 2, 3)} | {f"nu{i}": m["poisson"] for i in (12, 13, 23)}
        m |= dict.fromkeys(("G12", "G13", "G23"), m["young"] / (2 + 2 * m["poisson"]))
    if "E_axial" in m:
        E = m["E_transverse"]
        G = m["G_transverse"] if "G_transverse" in m else E / (2 + 2 * m["nu_transverse"])
        m |= {"E1": E, "E2": E, "E3": m["E_axial"], "nu12": E / (2 * G) - 1, "G12": G}
        # Contraction along x3 under stress across: nu_13 / E_1 = nu_31 / E_3.
        m |= dict.fromkeys(("nu13", "nu23"), m["nu_axial"] * E / m["E_axial"])
        m |= dict.fromkeys(("G13", "G23"), m["G_axial"])
    S = np.diag([1 / m[name] for name in ("E1", "E2", "E3", "G23", "G13", "G12")])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        S[i, j] = S[j, i] = -m[f"nu{i + 1}{j + 1}"] / m[f"E{i + 1}"]
    C, alpha = np.linalg.inv(S), expansion_in_axes(m)
    angle = np.radians(m.get("angle", 0.0))
    return rotated(C, angle), None if alpha is None else rotated_strain(alpha, angle)


def expansion_in_axes(m):
    """(6,) along the axes of the material, or None."""
    if "expansion_axial" in m:
        return np.array([m["expansion_transverse"], m["expansion_transverse"], m["expansion_axial"], 0, 0, 0])
    alpha = m.get("expansion")
    if alpha is None:
        return None
    return np.r_[np.broadcast_to(np.asarray(alpha, float), 3), 0, 0, 0]


def about_x3(angle):
    """(3, 3) rotation matrix."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def rotated(C, angle):
    """Return the stiffness of a body that is turned about x3: C_abcd = Q_ai Q_bj Q_ck Q_dl C_ijkl."""
    tensor = np.zeros((3, 3, 3, 3))
    for a, (i, j) in enumerate(PAIRS):
        for b, (k, m) in enumerate(PAIRS):
            tensor[i, j, k, m] = tensor[j, i, k, m] = tensor[i, j, m, k] = tensor[j, i, m, k] = C[a, b]
    Q = about_x3(angle)
    turned = np.einsum("ai,bj,ck,dl,ijkl->abcd", Q, Q, Q, Q, tensor)
    return np.array([[turned[a][b] for b in PAIRS] for a in PAIRS])


def rotated_strain(strain, angle):
    """(6,) strains of a body that is turned about x3."""
    tensor = np.zeros((3, 3))
    for value, (i, j) in zip(strain, PAIRS, strict=True):
        tensor[i, j] = tensor[j, i] = value if i == j else value / 2
    Q = about_x3(angle)
    turned = Q @ tensor @ Q.T
    return np.array([turned[i, j] * (1 if i == j else 2) for i, j in PAIRS])


def laminate(phases, fractions, across, springs=(np.inf, np.inf)):
    """Stiffness (6, 6) and thermal stress (6,) of layers normal to the axis `across`.

    There are two interfaces in a period of one of the stiffnesses `springs`, normal and tangential; `phases` are pairs
    of stiffness and expansion.

    The stresses s_a that act across the layers and the strains E_b along them are the same in all layers, and
    E_a = <e_a> + jumps:
    e_a = alpha_a + A (s_a - C_ab (E_b - alpha_b)), A = C_aa^-1, s_b = C_ba (e_a - alpha_a) + C_bb (E_b - alpha_b).
    """
    a, b = ([0, 4, 5], [1, 2, 3]) if across == 0 else ([1, 3, 5], [0, 2, 4])

    def mean(function):
        return sum(c * function(*phase) for c, phase in zip(fractions, phases, strict=True))

    def soft(C):
        return np.linalg.inv(C[np.ix_(a, a)])

    jumps = np.diag([2 / springs[0], 2 / springs[1], 2 / springs[1]])
    compliance = mean(lambda C, _: soft(C)) + jumps
    along = mean(lambda C, _: soft(C) @ C[np.ix_(a, b)])
    free = mean(lambda C, alpha: alpha[a] + soft(C) @ C[np.ix_(a, b)] @ alpha[b])

    def stress(E, T):
        s_a = np.linalg.solve(compliance, E[a] - free * T + along @ E[b])

        def of_layer(C, alpha):
            held = E[b] - alpha[b] * T
            e_a = soft(C) @ (s_a - C[np.ix_(a, b)] @ held)
            return C[np.ix_(b, a)] @ e_a + C[np.ix_(b, b)] @ held

        result = np.empty(6)
        result[a], result[b] = s_a, mean(of_layer)
        return result

    return np.array([stress(E, 0.0) for E in np.eye(6)]).T, stress(np.zeros(6), 1.0)


def axial_constants(material):
    """E, nu and plane strain bulk modulus k of an isotropic or transversely isotropic phase under axial load."""
    C, _ = law(material)
    S = np.linalg.inv(C)
    return 1 / S[2, 2], -S[0, 2] / S[2, 2], (C[0, 0] + C[0, 1]) / 2


def hill(matrix, fibre, fractions, K23):
    """Axial E and nu of any arrangement of two phases from its bulk modulus across (Hill 1964).

    E = <E> + 4 d^2 b, nu = <nu> - d b, d = (nu_f - nu_m) / (1/k_f - 1/k_m), b = <1/k> - 1/K23.
    """
    E, nu, k = np.transpose([axial_constants(matrix), axial_constants(fibre)])
    d, b = (nu[1] - nu[0]) / (1 / k[1] - 1 / k[0]), fractions @ (1 / k) - 1 / K23
    return fractions @ E + 4 * d**2 * b, fractions @ nu - d * b


def levin(matrix, fibre, fractions, S):
    """(6,) expansion of any arrangement of two phases from its compliance (Levin 1967).

    alpha = <alpha> + (S - <S>) (S_f - S_m)^-1 (alpha_f - alpha_m): the stress behind the mean makes, with a unit of
    temperature, the same strain in both phases.
    """
    (C_m, alpha_m), (C_f, alpha_f) = law(matrix), law(fibre)
    S_m, S_f, at = np.linalg.inv(C_m), np.linalg.inv(C_f), np.ix_(COUPLED, COUPLED)
    stress = np.zeros(6)
    stress[COUPLED] = np.linalg.solve((S_f - S_m)[at], (alpha_f - alpha_m)[COUPLED])
    mean_S, mean_alpha = (fractions[0] * m + fractions[1] * f for m, f in ((S_m, S_f), (alpha_m, alpha_f)))
    return mean_alpha + (S - mean_S) @ stress


def stiffness_of_constants(E1, E2, G12, G23, nu12, nu23):
    """(6, 6) with the fibre as axis 1 of the constants and x3 of the cell, of square or hexagonal arrangements."""
    S = np.diag([1 / E2, 1 / E2, 1 / E1, 1 / G12, 1 / G12, 1 / G23])
    S[0, 1] = S[1, 0] = -nu23 / E2
    S[2, :2] = S[:2, 2] = -nu12 / E1
    return np.linalg.inv(S)


def layered_contrast(fibre, coating, share):
    """Return the contrast of a homogeneous fibre that answers cos(n t) as one in a coating does.

    It is over the matrix, a function of n; `share` is the area of the fibre within that of both.
    """

    def contrast(n):
        reflected = (coating - fibre) / (coating + fibre) * share**n
        return coating * (1 - reflected) / (1 + reflected)

    return contrast


def axial_shear_modulus(geometry, c, contrast, terms=40):
    """Axial shear modulus of round fibres over that of the matrix, by Rayleigh's method.

    Perrins, McKenzie, McPhedran 1979: Re B_n z^-n about each fibre, n odd, a its radius,

    B_n / (g a^2n) + sum_m (m+n-1 over n) S_(m+n) B_m = delta_n1, g = (1 - contrast) / (1 + contrast),

    with the sums S_k of z^-k over the lattice; the modulus is 1 - 2 pi B_1 / area.  Of fibres in layers the contrast
    is a function of n, as `layered_contrast` makes one.
    """
    skew = 1j if geometry == "square" else np.exp(1j * np.pi / 3)
    area = skew.imag
    i, j = np.meshgrid(np.arange(-60, 61), np.arange(-60, 61))
    z = (i + skew * j).ravel()
    z = z[np.abs(z) > 0.5]
    # S_2 is that of a lattice without a direction, S_4 and S_6 are Eisenstein's; of higher ones few cells are enough.
    sums = {2: np.pi / area} | ({4: 3.1512120021538977, 6: 0} if geometry == "square" else {4: 0, 6: 5.863031693414968})
    a, n = np.sqrt(c * area / np.pi), np.arange(1, 2 * terms, 2)
    own = np.broadcast_to(contrast(n) if callable(contrast) else contrast, terms)
    A = np.diag((1 + own) / (1 - own))
    for row, p in enumerate(n):
        for column, m in enumerate(n):
            k = int(m + p)
            if k not in sums:
                sums[k] = (z**-k).sum().real
            A[row, column] += comb(m + p - 1, p) * sums[k] * a**k
    # Unknowns B_n / a^n.
    B = np.linalg.solve(A, np.eye(terms)[0] * a)
    return 1 - 2 * np.pi * B[0] * a / area
