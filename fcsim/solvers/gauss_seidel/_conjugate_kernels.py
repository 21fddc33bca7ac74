"""The direction of the nonsmooth nonlinear conjugate gradient method, one pass over the contacts; compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from numba import njit


@njit(cache=True)
def follow_direction(before, after, direction, last):
    """Go from `after` along the conjugate direction, in place on direction and before (nc, 3), which becomes the next sweep's start.

    before, after: reactions before and after a sweep, g = before - after the gradient; last: ||g||^2 of the sweep before (0: none).
    Return ||g||^2 and ||after||^2. A contact that the sweep left as it is (an open one) has no direction: it would die away through
    denormal numbers, which are slow.
    """
    square = 0.0
    size = 0.0
    for a in range(len(before)):
        for i in range(3):
            g = before[a, i] - after[a, i]
            square += g * g
            size += after[a, i] * after[a, i]
    beta = square / last if last > 0.0 else 2.0
    for a in range(len(before)):
        still = True
        for i in range(3):
            still = still and before[a, i] == after[a, i]
        for i in range(3):
            if beta > 1.0 or still:
                direction[a, i] = 0.0
                before[a, i] = after[a, i]
            else:
                g = before[a, i] - after[a, i]
                before[a, i] = after[a, i] + beta * direction[a, i]
                direction[a, i] = beta * direction[a, i] - g
    return square, size
