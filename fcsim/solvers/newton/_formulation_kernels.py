"""The equations of Alart-Curnier and of Jean-Moreau with their derivatives, and what their rho comes from; loops compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

ALART_CURNIER, SPLIT = np.bool_(False), np.bool_(True)
"""`jean_moreau`, `split` where compiled functions call these: to numba False and True alone are types of their own, compiled once more."""


@njit(cache=True)
def disk_equations(u, r, mu, rho, jean_moreau):
    """F (nc, d), A = dF/du and B = dF/dr (nc, d, d) of `formulations.alart_curnier`, or of `formulations.jean_moreau`.

    Normal: F_N = r_N - [y_N]_+; tangential: F_T = r_T - P_D(y_T), with y = r - rho u and the disk D of radius mu [y_N]_+ or mu [r_N]_+.
    """
    nc, d = u.shape
    F, A, B = np.empty((nc, d)), np.zeros((nc, d, d)), np.zeros((nc, d, d))
    y, n = np.empty(d), np.empty(d)
    for a in range(nc):
        norm2 = 0.0
        for i in range(d):
            y[i] = r[a, i] - rho[a, i] * u[a, i]
            if i > 0:
                norm2 += y[i] * y[i]
        norm = np.sqrt(norm2)
        if y[0] > 0.0:
            F[a, 0] = r[a, 0] - y[0]
            A[a, 0, 0] = rho[a, 0]
        else:
            F[a, 0] = r[a, 0]
            B[a, 0, 0] = 1.0
        pressure = r[a, 0] if jean_moreau else y[0]
        radius = mu[a] * max(pressure, 0.0)
        if norm <= radius and radius > 0.0:  # a disk of radius 0 (open, mu = 0) holds nothing: F_T = r_T
            for i in range(1, d):
                F[a, i] = r[a, i] - y[i]
                A[a, i, i] = rho[a, i]
            continue
        scale = 1.0 / norm if norm > 0.0 else 1.0
        ratio = radius * scale
        widening = mu[a] if pressure > 0.0 else 0.0  # of the disk by y_N or r_N
        for i in range(1, d):
            n[i] = y[i] * scale
        for i in range(1, d):
            F[a, i] = r[a, i] - radius * n[i]
            if not jean_moreau:
                A[a, i, 0] = widening * rho[a, 0] * n[i]
            B[a, i, 0] = -widening * n[i]
            for j in range(1, d):
                P = ratio * ((1.0 if i == j else 0.0) - n[i] * n[j])  # P_D'(y) = radius / ||y|| (1 - n n^T) outside the disk
                A[a, i, j] = P * rho[a, j]
                B[a, i, j] = (1.0 if i == j else 0.0) - P
    return F, A, B


@njit(cache=True, nogil=True)
def disk_misses(u, r, mu, rho, weight):
    """||weight F||^2 (nc,) of each contact for F of `formulations.alart_curnier`, as `disk_equations` has it."""
    nc, d = u.shape
    squares, y = np.empty(nc), np.empty(d)
    for a in range(nc):
        norm2 = 0.0
        for i in range(d):
            y[i] = r[a, i] - rho[a, i] * u[a, i]
            if i > 0:
                norm2 += y[i] * y[i]
        norm, radius = np.sqrt(norm2), mu[a] * max(y[0], 0.0)
        missed = weight[a] * (r[a, 0] - max(y[0], 0.0))
        total, scale = missed * missed, 1.0 / norm if norm > 0.0 else 1.0
        holds = norm <= radius and radius > 0.0
        for i in range(1, d):
            missed = weight[a] * (r[a, i] - (y[i] if holds else radius * (y[i] * scale)))
            total += missed * missed
        squares[a] = total
    return squares


@njit(cache=True)
def split_compliances(W):
    """W_NN and lambda_max(W_TT) (nc, d) of one-contact matrices W (nc, d, d), the latter for each tangent, from W_TT's lower triangle;
    with rolling and spinning friction (d = 5, 6) so of W_RR and W_SS too."""
    nc, d = len(W), W.shape[1]
    largest = np.empty((nc, d))
    for a in range(nc):
        largest[a, 0] = W[a, 0, 0]
        for i in range(1, d, 2):
            if i + 1 < d:
                first, second = W[a, i, i], W[a, i + 1, i + 1]
                largest[a, i] = 0.5 * (first + second) + np.hypot(0.5 * (first - second), W[a, i + 1, i])
                largest[a, i + 1] = largest[a, i]
            else:
                largest[a, i] = W[a, i, i]
    return largest


@njit(cache=True)
def rho_factor(stretch, size):
    """By what rho is multiplied for a step with rho ||du|| = stretch and ||dr|| = size, see `scaling.adapt_rho`."""
    return 2.0 / 3.0 if stretch > 0.9 * size else 1.5 if stretch < 0.3 * size else 1.0


@njit(cache=True)
def adapted_rho(rho, least, most, du, dr, split):
    """rho (nc, d) of `scaling.adapt_rho` between least and most (nc, d), for the steps du, dr (nc, d)."""
    nc, d = rho.shape
    adapted = np.empty((nc, d))
    for a in range(nc):
        for begin, end in ((0, 1), (1, min(d, 3)), (3, min(d, 5)), (5, d)) if split else ((0, d), (d, d), (d, d), (d, d)):
            u_size, r_size = 0.0, 0.0
            for i in range(begin, end):
                u_size += du[a, i] * du[a, i]
                r_size += dr[a, i] * dr[a, i]
            if begin >= end:
                continue
            stretch, r_size = rho[a, begin] * np.sqrt(u_size), np.sqrt(r_size)
            factor = rho_factor(stretch, r_size)
            for i in range(begin, end):
                adapted[a, i] = min(max(rho[a, i] * factor, least[a, i]), most[a, i])
    return adapted
