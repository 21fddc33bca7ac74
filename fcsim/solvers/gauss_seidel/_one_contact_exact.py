"""One-contact solvers by enumeration and by Glocker's complementarity problem, with the signature of `_one_contact_kernels`."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.solvers.gauss_seidel._one_contact_kernels import newton_alart_curnier


@njit(cache=True)
def _frictionless(W00, q0):
    return (max(-q0 / W00, 0.0), 0.0, 0.0, True) if W00 > 0.0 else (0.0, 0.0, 0.0, q0 >= 0.0)


@njit(cache=True)
def enumerate_cases(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Take-off, stick, slide in turn; sliding by the quartic (Bonnefon, Daviet, "Quartic formulation of Coulomb 3D frictional contact",
    INRIA 2011). Where that finds nothing (W_NN or the Schur complement not positive), Newton on AC.

    Sliding: u_N = 0 and u_T = -alpha r_T, alpha > 0, give (S + alpha I) r_T = -p with the Schur complement S of W_NN and
    p = q_T - W_TN q_N / W_NN. ||r_T|| = mu r_N is then a quartic in alpha; of its two factors the one with r_N > 0 is
        psi(alpha) = W_NN ||a|| + mu (q_N det - W_NT a),  a = adj(S + alpha I) p,  det = det(S + alpha I),
    positive at alpha = 0, where sticking breaks the cone, negative far out: its root is bracketed, and polished by Newton.

    Long because its cases share what was computed for the cases before.
    """
    if q0 >= 0.0:  # take-off
        return 0.0, 0.0, 0.0, True
    W00 = W[0][0]
    if not W00 > 0.0:
        return newton_alart_curnier(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)
    if mu == 0.0:
        return _frictionless(W00, q0)
    S11, S12 = W[1][1] - W[1][0] * W[0][1] / W00, W[1][2] - W[1][0] * W[0][2] / W00
    S21, S22 = W[2][1] - W[2][0] * W[0][1] / W00, W[2][2] - W[2][0] * W[0][2] / W00
    p1, p2 = q1 - W[1][0] * q0 / W00, q2 - W[2][0] * q0 / W00
    det = S11 * S22 - S12 * S21
    a1, a2 = S22 * p1 - S12 * p2, S11 * p2 - S21 * p1
    if det > 0.0:  # stick
        t1, t2 = -a1 / det, -a2 / det
        t0 = -(q0 + W[0][1] * t1 + W[0][2] * t2) / W00
        if t1 * t1 + t2 * t2 <= (mu * t0) ** 2 and t0 >= 0.0:
            return t0, t1, t2, True
    trace = S11 + S22
    psi = W00 * np.sqrt(a1 * a1 + a2 * a2) + mu * (q0 * det - W[0][1] * a1 - W[0][2] * a2)
    if not (psi > 0.0 and trace > 0.0 and det >= 0.0):
        return newton_alart_curnier(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)
    low, high = 0.0, np.inf
    # start from the alpha of the given reaction, u_T = -alpha r_T
    alpha, length = trace, r1 * r1 + r2 * r2
    if length > 0.0:
        u1 = W[1][0] * r0 + W[1][1] * r1 + W[1][2] * r2 + q1
        u2 = W[2][0] * r0 + W[2][1] * r1 + W[2][2] * r2 + q2
        guess = -(u1 * r1 + u2 * r2) / length
        if guess > 0.0:
            alpha = guess
    for _ in range(200):
        det = (S11 + alpha) * (S22 + alpha) - S12 * S21
        a1, a2 = (S22 + alpha) * p1 - S12 * p2, (S11 + alpha) * p2 - S21 * p1
        norm = np.sqrt(a1 * a1 + a2 * a2)
        psi = W00 * norm + mu * (q0 * det - W[0][1] * a1 - W[0][2] * a2)
        if psi > 0.0:
            low = alpha
        else:
            high = alpha
        if psi == 0.0 or not np.isfinite(psi):
            break
        slope = W00 * (a1 * p1 + a2 * p2) / norm if norm > 0.0 else 0.0  # da/dalpha = p
        slope += mu * (q0 * (trace + 2 * alpha) - W[0][1] * p1 - W[0][2] * p2)
        step = -psi / slope if slope != 0.0 else np.inf
        new = alpha + step
        if not low < new < high:
            new = 4 * alpha if np.isinf(high) else 0.5 * (low + high)
        if abs(new - alpha) <= 2e-16 * (alpha + 1e-3 * trace):
            break
        alpha = new
    if np.isinf(high) or not np.isfinite(psi):
        return newton_alart_curnier(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)
    t1, t2 = -a1 / det, -a2 / det
    return -(q0 + W[0][1] * t1 + W[0][2] * t2) / W00, t1, t2, True


@njit(cache=True)
def _solve5(A, b):
    """Gaussian elimination with partial pivoting in place; a vanishing pivot (multipliers that are not unique) is lifted to round-off."""
    scale = np.abs(A).max() + 1e-300
    for k in range(5):
        pivot = k
        for i in range(k + 1, 5):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(5):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            b[k], b[pivot] = b[pivot], b[k]
        if abs(A[k, k]) < 1e-12 * scale:
            A[k, k] = 1e-12 * scale
        for i in range(k + 1, 5):
            factor = A[i, k] / A[k, k]
            if factor != 0.0:
                for j in range(k + 1, 5):
                    A[i, j] -= factor * A[k, j]
                b[i] -= factor * b[k]
    for k in range(4, -1, -1):
        for j in range(k + 1, 5):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]


@njit(cache=True)
def _glocker_function(V, v, mu, threshold, E, y, x, F):
    """Fill x = (r_N, r_T) and F(y) of Glocker's problem 0 <= y ⊥ F(y) >= 0; see `_glocker_newton`."""
    radius = mu * y[0] if threshold < 0.0 else threshold
    x[0] = y[0]
    x[1] = E[0, 0] * (radius - y[1]) + E[0, 1] * (radius - y[2])
    x[2] = E[1, 0] * (radius - y[1]) + E[1, 1] * (radius - y[2])
    u0 = V[0, 0] * x[0] + V[0, 1] * x[1] + V[0, 2] * x[2] + v[0]
    h1 = -(V[1, 0] * x[0] + V[1, 1] * x[1] + V[1, 2] * x[2] + v[1]) - y[4] * x[1]
    h2 = -(V[2, 0] * x[0] + V[2, 1] * x[1] + V[2, 2] * x[2] + v[2]) - y[4] * x[2]
    F[0] = u0
    F[1] = E[0, 0] * h1 + E[1, 0] * h2 + y[3]
    F[2] = E[0, 1] * h1 + E[1, 1] * h2 + y[3]
    F[3] = 3 * radius - y[1] - y[2]
    F[4] = 0.5 * (radius * radius - x[1] * x[1] - x[2] * x[2])


@njit(cache=True)
def _merit(y, F):
    total = 0.0
    for i in range(5):
        phi = y[i] + F[i] - np.sqrt(y[i] * y[i] + F[i] * F[i])
        total += phi * phi
    return total


@njit(cache=True)
def _glocker_newton(V, v, mu, threshold, E, y, x, tol, max_iterations):
    """Newton with Armijo's rule on the Fischer-Burmeister equations of Glocker's NCP, from y in place; return whether ||Phi|| <= tol.

    Glocker (Comput. Methods Appl. Mech. Eng. 177, 1999): the friction disk is cut out of a triangle whose sides touch it at the unit
    vectors e_1 + e_2 + e_3 = 0, so that five complementary pairs have a solution also where mu r_N = 0:
        0 <= (r_N, sigma_1, sigma_2, kappa_3, kappa_D) ⊥ (u_N, kappa_1, kappa_2, sigma_3, sigma_D) >= 0,
        sigma_i = mu r_N - e_i r_T,  sigma_D = ((mu r_N)^2 - r_T^2) / 2,  -u_T = sum_i kappa_i e_i + kappa_D r_T.
    E is the inverse of the matrix with rows e_1, e_2. With threshold >= 0 it stands for mu r_N (fixed point on the threshold).

    Long because its three equations and their derivatives are written out.
    """
    F, G, z = np.empty(5), np.empty(5), np.empty(5)
    J, b = np.empty((5, 5)), np.empty(5)
    Fp = np.zeros((5, 5))
    dx = np.zeros((3, 3))
    _glocker_function(V, v, mu, threshold, E, y, x, F)
    value = _merit(y, F)
    coupled = threshold < 0.0
    for _ in range(max_iterations):
        if value <= tol * tol:
            return True
        # F'(y): columns r_N, sigma_1, sigma_2 through x, then kappa_3, kappa_D
        m = mu if coupled else 0.0
        dx[0, 0] = 1.0
        for i in range(2):
            dx[1 + i, 0] = m * (E[i, 0] + E[i, 1])
            dx[1 + i, 1], dx[1 + i, 2] = -E[i, 0], -E[i, 1]
        for j in range(3):
            h1 = -y[4] * dx[1, j]
            h2 = -y[4] * dx[2, j]
            u0 = 0.0
            for k in range(3):
                u0 += V[0, k] * dx[k, j]
                h1 -= V[1, k] * dx[k, j]
                h2 -= V[2, k] * dx[k, j]
            Fp[0, j] = u0
            Fp[1, j] = E[0, 0] * h1 + E[1, 0] * h2
            Fp[2, j] = E[0, 1] * h1 + E[1, 1] * h2
            Fp[4, j] = -x[1] * dx[1, j] - x[2] * dx[2, j]
        Fp[4, 0] += m * mu * y[0]
        Fp[3, 0], Fp[3, 1], Fp[3, 2] = 3 * m, -1.0, -1.0
        Fp[1, 3] = Fp[2, 3] = 1.0
        Fp[1, 4] = -(E[0, 0] * x[1] + E[1, 0] * x[2])
        Fp[2, 4] = -(E[0, 1] * x[1] + E[1, 1] * x[2])
        for i in range(5):
            norm = np.sqrt(y[i] * y[i] + F[i] * F[i])
            da = 1 - y[i] / norm if norm > 0 else 1 - np.sqrt(0.5)
            db = 1 - F[i] / norm if norm > 0 else 1 - np.sqrt(0.5)
            for j in range(5):
                J[i, j] = db * Fp[i, j]
            J[i, i] += da
            b[i] = -(y[i] + F[i] - norm)
        _solve5(J, b)
        t, new = 1.0, np.inf
        for _ in range(20):
            for i in range(5):
                z[i] = y[i] + t * b[i]
            _glocker_function(V, v, mu, threshold, E, z, x, G)
            new = _merit(z, G)
            if new <= (1 - 2e-4 * t) * value:
                break
            t *= 0.5
        if not new < value:
            return False
        value = new
        for i in range(len(z)):
            y[i], F[i] = z[i], G[i]
    return value <= tol * tol


# To numba True, False and a number alone are types of their own: for each of them what takes it would be compiled once more.
@njit(cache=True)
def _glocker(fixed_point, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    if q0 >= 0.0:  # the trivial solution, where the multipliers are not unique
        return 0.0, 0.0, 0.0, True
    if mu == 0.0:
        return _frictionless(W[0][0], q0)
    # numbers without unit: V = rho W, v = rho q / s, x = r / s
    s = rho_N * np.sqrt(q0 * q0 + q1 * q1 + q2 * q2)
    V = rho_N * np.array([[W[0][0], W[0][1], W[0][2]], [W[1][0], W[1][1], W[1][2]], [W[2][0], W[2][1], W[2][2]]])
    v = np.array([q0, q1, q2]) * (rho_N / s)
    # the triangle is turned so that the expected direction of friction lies between e_1 and e_2: sides and disk then touch elsewhere
    f1, f2 = (r1, r2) if r1 * r1 + r2 * r2 > 0.0 else (-q1, -q2)
    norm = np.sqrt(f1 * f1 + f2 * f2)
    c, d = (f1 / norm, f2 / norm) if norm > 0.0 else (1.0, 0.0)
    h, w = 0.5, np.sqrt(0.75)
    # rows e_1 = (h c - w d, w c + h d), e_2 = (h c + w d, -w c + h d), inverted
    e11, e12, e21, e22 = h * c - w * d, w * c + h * d, h * c + w * d, h * d - w * c
    det = e11 * e22 - e12 * e21
    E = np.array([[e22 / det, -e12 / det], [-e21 / det, e11 / det]])
    y, x = np.zeros(5), np.array([max(r0, 0.0) / s, r1 / s, r2 / s])
    if x[0] == 0.0:
        x[0] = 1.0
    radius = mu * x[0]
    y[0] = x[0]
    y[1] = max(radius - e11 * x[1] - e12 * x[2], 0.0)
    y[2] = max(radius - e21 * x[1] - e22 * x[2], 0.0)
    local_tol = max(tol / s, 1e-15)
    if not fixed_point:
        solved = _glocker_newton(V, v, mu, -1.0, E, y, x, local_tol, max_iterations)
    else:
        solved = False
        for _ in range(max_iterations):
            threshold = mu * y[0]
            if not _glocker_newton(V, v, mu, threshold, E, y, x, local_tol, np.int64(50)):
                break
            if abs(mu * y[0] - threshold) <= local_tol:
                solved = True
                break
    if solved:
        return s * y[0], s * x[1], s * x[2], True
    return newton_alart_curnier(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)


@njit(cache=True)
def glocker_newton(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Glocker's NCP by Newton on its Fischer-Burmeister equations; where that fails, Newton on AC."""
    return _glocker(np.bool_(False), W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)


@njit(cache=True)
def glocker_fixed_point(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Glocker's NCP by the fixed point on its threshold mu r_N, each problem of fixed threshold by Fischer-Burmeister Newton."""
    return _glocker(np.bool_(True), W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)
