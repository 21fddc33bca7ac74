"""The statuses of contacts at a solution, where they are clear: with them fixed, Coulomb's law is smooth.

A solution is differentiable where every contact is strictly open (r = 0, u_N > 0), strictly sticking (u = 0, ||r_T|| < mu r_N) or strictly
sliding (r_N > 0, u_T != 0). On the borders between them it has one-sided derivatives at best.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray
from fcsim.errors import InputError
from fcsim.problem import OPEN, SLIP, STICK

NAMED = 5
"""Contacts on a border that a message names."""


def strict_statuses(y: FloatArray, u: FloatArray, mu: FloatArray, small: float) -> NDArray[np.int8]:
    """OPEN, STICK or SLIP (nc,) of contacts with y = s r and u (nc, d) [velocity], what is at most `small` counting as zero.

    Without friction (mu = 0) a closed contact slides, moving or not. Raises InputError that names the contacts which are on a border:
    closed without a reaction, about to slide, or about to stop.
    """
    size, speed = np.linalg.norm(y[:, 1:], axis=1), np.linalg.norm(u[:, 1:], axis=1)
    pushed, moving = y[:, 0] > small, speed > small
    inside = mu * y[:, 0] - size > small
    status = np.full(len(mu), OPEN, dtype=np.int8)
    status[pushed & inside & ~moving] = STICK
    status[pushed & ~inside & (moving | (mu == 0))] = SLIP
    _refuse(~pushed & (u[:, 0] <= small), "touch without a reaction")
    _refuse(pushed & ~inside & ~moving & (mu > 0), "are about to slide: at the cone's surface without a velocity")
    _refuse(pushed & inside & moving, "slide inside the friction cone: no solution, or one that is not exact enough")
    return status


def _refuse(contacts: BoolArray, what: str) -> None:
    """InputError where there are such contacts (nc,)."""
    if not contacts.any():
        return
    which = np.flatnonzero(contacts)
    named = ", ".join(map(str, which[:NAMED])) + (", ..." if len(which) > NAMED else "")
    raise InputError(
        f"derivative: expected contacts that are clearly open, sticking or sliding, got {len(which)} that {what} (contact {named}); the "
        "solution has no derivative there (a smaller margin counts more as clear)"
    )
