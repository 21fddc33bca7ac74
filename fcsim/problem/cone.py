"""Coulomb's second-order cone: projections, the De Saxcé term g(u) and their derivatives, on arrays (nc, d), d in {2, 3}.

The cone of contact a is K = {r : ||r_T|| <= mu r_N}, its dual K* = {u : mu ||u_T|| <= u_N}; the normal component comes first.
Formulas: Acary, Brémond, Huber, "On solving contact problems with Coulomb friction: formulations and numerical comparisons",
in Advanced Topics in Nonsmooth Dynamics, Springer, 2018.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.problem._cone_kernels import cone_projections

LEAST_SIZE = 1e-120
"""Of what is squared: below, squares are lost, the first digits at 1e-154."""


def enlargement(largest: float) -> float:
    """The power of two that brings numbers up to that size, > 0, to about 1, or as far as one factor can, and loses no digit."""
    return float(2.0 ** min(-math.frexp(largest)[1], 1000))


def tangential_norm(z: FloatArray) -> FloatArray:
    """Return ||z_T|| (nc,) of vectors z (nc, d)."""
    return np.sqrt(np.einsum("ai,ai->a", z[:, 1:], z[:, 1:]))


def de_saxce(u: FloatArray, mu: FloatArray) -> FloatArray:
    """Return g(u) = (mu ||u_T||, 0, 0) (nc, d), in the unit of u (nc, d)."""
    g = np.zeros_like(u)
    g[:, 0] = mu * tangential_norm(u)
    return g


def _zones(z: FloatArray, mu: FloatArray) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    norm = tangential_norm(z)
    inside = (norm <= mu * z[:, 0]) & (mu > 0)  # for mu = 0 the cone is a half-line, without an inside
    polar = ~inside & (mu * norm <= -z[:, 0])
    return norm, inside, polar


def project_cone(z: FloatArray, mu: FloatArray) -> FloatArray:
    """Return the Euclidean projection P_K(z) (nc, d) on the cones of friction coefficients mu (nc,).

    z inside K stays; z in the polar cone -K* goes to 0; otherwise, with s = (z_N + mu ||z_T||) / (1 + mu^2),
    P = (s, mu s z_T / ||z_T||).
    """
    return cone_projections(np.ascontiguousarray(z, dtype=np.float64), mu)


def project_cone_derivative(z: FloatArray, mu: FloatArray) -> FloatArray:
    """Return one element (nc, d, d) of the generalised Jacobian of P_K at z."""
    nc, d = z.shape
    norm, inside, polar = _zones(z, mu)
    safe = np.where(norm > 0, norm, 1)
    t = z[:, 1:] / safe[:, None]
    s = (z[:, 0] + mu * norm) / (1 + mu**2)
    derivative = np.empty((nc, d, d))
    scale = 1 / (1 + mu**2)
    derivative[:, 0, 0] = scale
    derivative[:, 0, 1:] = (mu * scale)[:, None] * t
    derivative[:, 1:, 0] = (mu * scale)[:, None] * t
    tt = t[:, :, None] * t[:, None, :]
    derivative[:, 1:, 1:] = (mu**2 * scale)[:, None, None] * tt + (mu * s / safe)[:, None, None] * (np.eye(d - 1) - tt)
    derivative[inside] = np.eye(d)
    derivative[polar] = 0
    return derivative
