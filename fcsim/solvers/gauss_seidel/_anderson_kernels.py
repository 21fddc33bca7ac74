"""Anderson's mixing of one more point into a window of the last ones, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear.block_factors._dense_kernels import solve_dense

NEARLY_DEPENDENT = 1e-14
"""What is added to the diagonal 1 of the normal equations of gamma, in differences of length 1, which may be nearly dependent."""


@njit(cache=True)
def mix(f, g, last_f, last_g, steps, images, normal, place, count):
    """Replace g (k,) by the mixed point, in place on what is kept of the window; `place` is where this difference goes.

    f = g - x of this point, last_f, last_g those of the one before, replaced by these; steps, images (window, k): differences of f, of
    length 1, and of g, divided by the same; normal (window, window): steps steps^T; count: differences that are kept, this one included
    (0: none, and there is nothing to mix).
    """
    if count > 0:
        square = 0.0
        for i in range(len(f)):
            steps[place, i] = f[i] - last_f[i]
            images[place, i] = g[i] - last_g[i]
            square += steps[place, i] * steps[place, i]
        length = np.sqrt(square) if square > 0.0 else 1.0  # two steps alike
        for i in range(len(f)):
            steps[place, i] /= length
            images[place, i] /= length
        products = np.dot(steps[:count], steps[place])
        for k in range(count):
            normal[place, k] = products[k]
        for k in range(count):
            normal[k, place] = normal[place, k]
        normal[place, place] += NEARLY_DEPENDENT
    for i in range(len(f)):
        last_f[i], last_g[i] = f[i], g[i]
    if count > 0:
        gamma, factors = np.dot(steps[:count], f), np.empty((count, count))
        for k in range(count):
            for j in range(count):
                factors[k, j] = normal[k, j]
        if solve_dense(factors, gamma):  # else, as of numbers that are none, the point stays
            mixed = np.dot(gamma, images[:count])
            for i in range(len(g)):
                g[i] -= mixed[i]
