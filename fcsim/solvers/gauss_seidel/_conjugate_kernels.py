"""The direction of the nonsmooth nonlinear conjugate gradient method, one pass over the contacts; compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from types import FunctionType
from typing import TYPE_CHECKING

from numba import njit

if TYPE_CHECKING:
    from numba.core.dispatcher import Dispatcher

one_sweep: Dispatcher
"""Stands for `_sweep_kernels.sweep` with a one-contact solver in the template below, see there."""


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


def sweep_conjugate(
    indptr, indices, blocks, diagonal, shift, q, mu, rho, order, reaction, frozen, start, direction, last, tolerance, iterations,
    relaxation, sweeps, enough,
):  # fmt: skip
    """At most `sweeps` steps in place on reaction, start, direction (nc, 3), ended by ||change|| <= enough ||reaction||.

    Arguments as in `_sweep_kernels.sweep` and `follow_direction`; return ||g||^2 and ||reaction||^2 of the last, how many there
    were, and how many one-contact problems were not solved in all of them.
    """
    size = 0.0
    done = 0
    failures = 0
    while done < sweeps:
        done += 1
        reaction[:] = start
        swept = one_sweep(  # noqa: F821
            indptr, indices, blocks, diagonal, shift, q, mu, rho, order, reaction, frozen, tolerance, iterations, relaxation, False, 0,
            0.0, 1, 0.0,
        )  # fmt: skip
        failures += swept[2]
        last, size = follow_direction(start, reaction, direction, last)
        if not last > enough * enough * size:  # NaN ends it too
            break
    return last, size, done, failures


def compiled(name, sweep):
    """`sweep_conjugate` with that sweep, compiled at its first call; `name` tells the entries of numba's cache apart."""
    template = FunctionType(sweep_conjugate.__code__, {**globals(), "one_sweep": sweep}, f"sweep_conjugate_{name}")
    template.__qualname__ = template.__name__
    return njit(cache=True)(template)
