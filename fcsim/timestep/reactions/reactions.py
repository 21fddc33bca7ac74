"""The reactions of a step at the contacts of another one, matched by what meets what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.brief import brief
from fcsim.contact_detection.contacts import Contacts
from fcsim.ranks import common_arrays, for_parts, in_parts, written
from fcsim.timestep.reactions._carry_kernels import carry

SHARED_FROM = 20_000
"""Contacts from which ranks share: as many take half a millisecond, an exchange a tenth."""

IN_COMMON_FROM = 3000
"""The same of several steps' reactions at once, where ranks write them to memory that they have in common."""

_SAME_WAY = 0.5
"""Cosine between a contact's normals before and after some motion; where it is less the contact is another one, of the far side."""


@dataclass(frozen=True, eq=False)
class Reactions:
    """The reactions of a step, to be matched contact by contact: identity (nc,), frame (nc, d, d), r (nc, d) in that frame, with rolling
    moments (nc, 5), with spinning moments (nc, 6)."""

    identity: NDArray[np.int64]
    frame: FloatArray
    r: FloatArray

    __repr__ = brief

    def transfer(self, contacts: Contacts, rows: int | None = None) -> FloatArray:
        """Return r (m,) for new contacts: the same vectors in space where the contact is known, zero where it is new; all ranks must ask.

        rows: unknowns a contact, None = d.
        """
        d = contacts.dimension
        shape, place = (len(contacts), d if rows is None else rows), np.empty(len(contacts), dtype=np.int64)
        moments = min(shape[1], self.r.shape[1]) > 3
        r: FloatArray = np.empty(shape) if moments else for_parts(shape, SHARED_FROM)

        def some(begin: int, end: int) -> None:
            own = slice(begin, end)
            r[own] = 0.0
            place[own] = carry(self.identity, self.frame, self.r, contacts.identity[own], contacts.frame[own], r[own])

        in_parts("reactions of earlier steps", len(contacts), SHARED_FROM, some, r, *([place] if moments else []))
        if moments:
            known = np.flatnonzero(place >= 0)
            old = place[known]
            frame, before, rolling = contacts.frame[known], self.frame[old], self.r[old, 3:5]
            r[known, 3:5] = rolling if d == 2 else np.einsum("aij,akj,ak->ai", frame[:, 1:], before[:, 1:], rolling)
            if min(r.shape[1], self.r.shape[1]) > 5:
                r[known, 5] = self.r[old, 5]
        return r.ravel()


def transferred(memory: Sequence[Reactions], contacts: Contacts) -> list[FloatArray]:
    """`transfer` of several steps' reactions; all ranks must ask."""
    nc, d = len(contacts), contacts.dimension
    shared = common_arrays(nc, IN_COMMON_FROM, ((len(memory), nc, d), np.float64)) if memory else None
    if shared is None:
        return [reactions.transfer(contacts) for reactions in memory]
    r = shared[0]
    r_of: list[FloatArray] = [own.ravel() for own in r]

    def some(begin: int, end: int) -> None:
        own = slice(begin, end)
        r[:, own] = 0.0
        for reactions, out in zip(memory, r, strict=True):
            carry(reactions.identity, reactions.frame, reactions.r, contacts.identity[own], contacts.frame[own], out[own])

    written("reactions of earlier steps", nc, some)
    return r_of


def carried(met: Contacts, r: FloatArray, contacts: Contacts) -> tuple[FloatArray, FloatArray]:
    """Return r (m,) of the contacts `met` at `contacts`, the same ones after some motion, zero at new ones: r_N along the normal as it is
    now, r_T turned with the normal, of the same length; and of r what has no contact there that looks the same way.

    What the tangent of contact takes for constant (`contact_tangent`), unlike vectors in space, which turn r_N into friction."""
    d, turned = contacts.dimension, np.zeros((len(contacts), contacts.dimension))
    if not len(met) or not len(contacts):
        return turned.ravel(), r
    old = r.reshape(-1, d)
    place = np.searchsorted(contacts.identity, met.identity).clip(max=len(contacts) - 1)
    same = contacts.identity[place] == met.identity
    same &= np.einsum("ad,ad->a", met.frame[:, 0], contacts.frame[place, 0]) > _SAME_WAY
    before, place = met.frame[same], place[same]
    tangential = np.einsum("aij,akj,ak->ai", contacts.frame[place, 1:], before[:, 1:], old[same, 1:])
    length, size = np.linalg.norm(tangential, axis=1), np.linalg.norm(old[same, 1:], axis=1)
    turned[place, 0] = old[same, 0]
    turned[place, 1:] = tangential * np.divide(size, length, out=np.ones_like(size), where=length > 0)[:, None]
    return turned.ravel(), np.where(same[:, None], 0.0, old).ravel()


def carried_in_space(met: Contacts, r: FloatArray, contacts: Contacts) -> tuple[FloatArray, FloatArray]:
    """The same as vectors in space, which stay whatever normal a contact has; nothing of r is said to be left."""
    return Reactions(met.identity, met.frame, r.reshape(-1, contacts.dimension)).transfer(contacts), np.zeros(0)
