"""Nonsmooth equations F(u, r) = 0 equivalent to K* ∋ u + g(u) ⊥ r ∈ K, with one element of their generalised Jacobian.

Each formulation is a function of (u, r, mu, rho), arrays (nc, d), (nc, d), (nc,), (nc, d), that returns F (nc, d), A = dF/du and
B = dF/dr (nc, d, d). rho > 0 turns velocities into impulses; its first column is rho_N, the others rho_T. Equations (8) to (10) of
Acary, Brémond, Huber, "On solving contact problems with Coulomb friction: formulations and numerical comparisons", 2018; AC is due to
Alart and Curnier (Comput. Methods Appl. Mech. Eng. 92, 1991), the disk of radius mu [r_N]_+ to Jean and Moreau (1987), FB for second-order
cones to Fukushima, Luo, Tseng (SIAM J. Optim. 12, 2002).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem.cone import de_saxce, project_cone, project_cone_derivative
from fcsim.solvers.newton._formulation_kernels import disk_equations

Linearisation = tuple[FloatArray, FloatArray, FloatArray]
Formulation = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], Linearisation]


def alart_curnier(u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray) -> Linearisation:
    """AC (eq. 8): the disk has radius mu [r_N - rho_N u_N]_+."""
    return disk_equations(u, r, mu, rho, False)


def jean_moreau(u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray) -> Linearisation:
    """JM (eq. 9): the disk has radius mu [r_N]_+."""
    return disk_equations(u, r, mu, rho, True)


def natural_map(u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray) -> Linearisation:
    """NM (eq. 10): F = r - P_K(r - rho (u + g(u))), one rho a contact (its first column)."""
    nc, d = u.shape
    rho_N = rho[:, :1]
    z = r - rho_N * (u + de_saxce(u, mu))
    P = project_cone_derivative(z, mu)
    norm = np.sqrt(np.einsum("ai,ai->a", u[:, 1:], u[:, 1:]))
    g_du = np.broadcast_to(np.eye(d), (nc, d, d)).copy()  # d(u + g(u))/du; at u_T = 0 the element 0 of the subdifferential of g
    g_du[:, 0, 1:] = mu[:, None] * u[:, 1:] / np.where(norm > 0, norm, 1)[:, None]
    return r - project_cone(z, mu), rho_N[:, :, None] * (P @ g_du), np.eye(d) - P


def fischer_burmeister(u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray) -> Linearisation:
    """FB: F = x + y - (x∘x + y∘y)^(1/2) in the Jordan algebra of the second-order cone L = {x_0 >= ||x_T||} (Fukushima, Luo, Tseng 2002).

    x = (r_N, r_T / mu) and y = rho (u_N + mu ||u_T||, mu u_T), one rho a contact (its first column), are in L where r is in K and
    u + g(u) in K*; F is scaled back by diag(1, mu) to the unit of r. A contact with mu = 0 has F_T = r_T and the scalar function in N.
    """
    nc, d = u.shape
    S = np.ones((nc, d))
    S[:, 1:] = np.where(mu > 0, mu, 1)[:, None]
    S_u = np.ones((nc, d))
    S_u[:, 1:] = mu[:, None]
    norm = np.sqrt(np.einsum("ai,ai->a", u[:, 1:], u[:, 1:]))
    x, y = r / S, rho[:, :1] * S_u * (u + de_saxce(u, mu))
    x[mu == 0, 1:] = 0  # these rows are replaced below
    root, inverse = _jordan_root(x, y)
    F = S * (x + y - root)
    dx = np.eye(d) - inverse @ _arrow(x)
    dy = np.eye(d) - inverse @ _arrow(y)
    origin = ~np.any(root, axis=1)  # x = y = 0: the element of the direction x = y = e
    dx[origin] = dy[origin] = (1 - np.sqrt(0.5)) * np.eye(d)
    g_du = np.broadcast_to(np.eye(d), (nc, d, d)).copy()  # d(u + g(u))/du, at u_T = 0 the element 0 of the subdifferential of g
    g_du[:, 0, 1:] = mu[:, None] * u[:, 1:] / np.where(norm > 0, norm, 1)[:, None]
    A = S[:, :, None] * dy @ ((rho[:, :1] * S_u)[:, :, None] * g_du)
    B = S[:, :, None] * dx / S[:, None, :]
    frictionless = mu == 0
    F[frictionless, 1:] = r[frictionless, 1:]
    A[frictionless, 1:] = 0
    B[frictionless, 1:] = np.eye(d)[1:]
    return F, A, B


def _arrow(x: FloatArray) -> FloatArray:
    """The matrix L_x of y -> x∘y = (x.y, x_0 y_T + y_0 x_T) (nc, d, d)."""
    L = x[:, :1, None] * np.eye(x.shape[1])
    L[:, 0, 1:] = L[:, 1:, 0] = x[:, 1:]
    return L


def _determinant(x: FloatArray) -> FloatArray:
    """x_0^2 - ||x_T||^2 (nc,) without cancellation."""
    norm = np.sqrt(np.einsum("ai,ai->a", x[:, 1:], x[:, 1:]))
    return (x[:, 0] - norm) * (x[:, 0] + norm)


def _jordan_root(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return t = (x∘x + y∘y)^(1/2) (nc, d) and L_t^-1 (nc, d, d), on the boundary of L its limit on L_x.

    With w = x∘x + y∘y the spectral values are lambda_2 = w_0 + ||w_T|| and lambda_1 = (w_0^2 - ||w_T||^2) / lambda_2, whose numerator
    is written without cancellation as (x_0^2 - ||x_T||^2 + y_0^2 - ||y_T||^2)^2 + 4 ||x_0 y_T - y_0 x_T||^2.
    """
    d = x.shape[1]
    w_T = 2 * (x[:, :1] * x[:, 1:] + y[:, :1] * y[:, 1:])
    size = np.sqrt(np.einsum("ai,ai->a", w_T, w_T))
    large = np.einsum("ai,ai->a", x, x) + np.einsum("ai,ai->a", y, y) + size
    safe = np.where(large > 0, large, 1)
    depth = _determinant(x) + _determinant(y)
    cross = x[:, :1] * y[:, 1:] - y[:, :1] * x[:, 1:]
    small = (depth**2 + 4 * np.einsum("ai,ai->a", cross, cross)) / safe
    a, b = np.sqrt(small), np.sqrt(large)
    n = w_T / np.where(size > 0, size, 1)[:, None]
    t = np.concatenate([0.5 * (a + b)[:, None], 0.5 * (b - a)[:, None] * n], axis=1)
    a, b = np.maximum(a, 1e-14 * b), np.sqrt(safe)
    a = np.where(large > 0, a, 1)
    # L_t has the eigenvalue b along (1, n), a along (1, -n) and (a + b) / 2 on what is left
    middle = 2 / (a + b)
    inverse = np.empty((len(x), d, d))
    inverse[:, 0, 0] = 0.5 * (1 / a + 1 / b)
    inverse[:, 0, 1:] = inverse[:, 1:, 0] = (0.5 * (1 / b - 1 / a))[:, None] * n
    nn = n[:, :, None] * n[:, None, :]
    inverse[:, 1:, 1:] = (0.5 * (1 / a + 1 / b) - middle)[:, None, None] * nn + middle[:, None, None] * np.eye(d - 1)
    return t, inverse


FORMULATIONS: dict[str, Formulation] = {
    "AC": alart_curnier,
    "JM": jean_moreau,
    "NM": natural_map,
    "FB": fischer_burmeister,
}
