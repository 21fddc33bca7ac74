"""The witness: every few steps the true overlap of the bodies, measured from their skins whatever detection found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.errors import InputError
from fcsim.witness.overlap import Overlap, PairOverlaps, measure
from fcsim.witness.skin import Skins, skins_of

_RESOLUTION = 1e-3
_NAMED = 3


@dataclass(frozen=True, kw_only=True)
class Witness:
    """When bodies' overlap is measured, and how much of it is borne.

    every      steps between two measurements; the last step is always measured
    tolerance  overlap borne, relative to the smallest extent of the smaller of two bodies; less than a thousandth of it counts as none
    initial    "refuse": bodies that overlap by more before the first step are an InputError; "allow": each pair may keep what it has then,
               beside the tolerance (a press fit)
    stop       whether a run ends with `fcsim.errors.Penetration` where more is seen; else it is only recorded

    A body is witnessed where its skin is closed: a deformable one always, a rigid one where its named surfaces enclose it; the notes of a
    run name the others. The fold of a body over itself is not seen.
    """

    every: int = 10
    tolerance: float = 1e-2
    initial: Literal["refuse", "allow"] = "refuse"
    stop: bool = True

    def __post_init__(self) -> None:
        if not (isinstance(self.every, int) and self.every >= 1):
            raise InputError(f"Witness, every: expected a whole number of steps >= 1, got {self.every!r}")
        if not (np.isfinite(self.tolerance) and self.tolerance > 0):
            raise InputError(f"Witness, tolerance: expected a number > 0, relative to the bodies' size, got {self.tolerance!r}")
        if self.initial not in ("refuse", "allow"):
            raise InputError(f"Witness, initial: expected 'refuse' or 'allow', got {self.initial!r}")


@dataclass(frozen=True, eq=False)
class Watch:
    """A witness at a model, from the initial configuration x (n_dofs,) on. InputError where bodies or their skins are refused there."""

    witness: Witness
    model: Model
    initial: FloatArray

    def __post_init__(self) -> None:
        seen = self._measure(self.initial, thorough=True)
        beyond = np.flatnonzero(seen.depth > self.witness.tolerance * self._size(seen.bodies))
        if len(beyond) and self.witness.initial == "refuse":
            raise InputError(self._refusal(seen, beyond))
        key = self._key(seen.bodies)
        order = np.argsort(key)
        object.__setattr__(self, "_allowed", (key[order], seen.depth[order]))

    _allowed: tuple[IntArray, FloatArray] = (np.empty(0, dtype=np.int64), np.empty(0))

    @cached_property
    def skins(self) -> Skins:
        return skins_of(self.model)[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the summary of a run says: the bodies that are not witnessed."""
        unseen = [body.name for body, closed in zip(self.model.bodies, self.skins.closed, strict=True) if not closed]
        if not unseen:
            return ()
        return (f"overlap is not witnessed at {_list(unseen)}: surfaces that do not enclose the body",)

    def look(self, x: FloatArray) -> Overlap:
        """The overlap in the configuration x (n_dofs,): of the pair that exceeds what it is allowed most, relative to its size."""
        seen = self._measure(x, thorough=False)
        if not len(seen.depth):
            return Overlap()
        size = self._size(seen.bodies)
        excess = (seen.depth - self._allowance(seen.bodies)) / size
        k = int(np.argmax(excess))
        a, b = (self.model.bodies[i].name for i in seen.bodies[k])
        beyond = bool(excess[k] > self.witness.tolerance)
        return Overlap(float(seen.depth[k]), float(seen.depth[k] / size[k]), (a, b), tuple(map(float, seen.point[k])), beyond)

    def _measure(self, x: FloatArray, thorough: bool) -> PairOverlaps:
        return measure(self.skins, self.model.positions(x), _RESOLUTION * self.witness.tolerance, thorough=thorough)

    def _size(self, bodies: IntArray) -> FloatArray:
        return self.skins.size[bodies].min(axis=1, initial=np.inf)

    def _key(self, bodies: IntArray) -> IntArray:
        return bodies[:, 0] * len(self.model.bodies) + bodies[:, 1]

    def _allowance(self, bodies: IntArray) -> FloatArray:
        """Overlap (n,) [m] that pairs of bodies (n, 2) may keep from the beginning."""
        keys, depth = self._allowed
        if self.witness.initial == "refuse" or not len(keys):
            return np.zeros(len(bodies))
        wanted = self._key(bodies)
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[place] == wanted, depth[place], 0.0)

    def _refusal(self, seen: PairOverlaps, beyond: IntArray) -> str:
        share = seen.depth / self._size(seen.bodies)
        worst = beyond[np.argsort(-share[beyond], kind="stable")]
        named = []
        for k in worst[:_NAMED]:
            a, b = (self.model.bodies[i].name for i in seen.bodies[k])
            at = ", ".join(f"{c:.4g}" for c in seen.point[k])
            named.append(f"{a!r} and {b!r} by {seen.depth[k]:.3g} m ({100 * share[k]:.3g} % of the smaller one's extent) at ({at})")
        more = f"; and {len(worst) - _NAMED} more pairs" if len(worst) > _NAMED else ""
        return (
            f"bodies overlap before the first step: {'; '.join(named)}{more}. Expected at most {100 * self.witness.tolerance:g} %: move them "
            "apart, or allow it with witness=Witness(initial='allow')"
        )


def penetration_seen(number: int, t: float, overlap: Overlap, tolerance: float) -> str:
    """The message of a run that stops after step `number` at time t [s] for its overlap."""
    assert overlap.bodies is not None
    a, b = overlap.bodies
    at = ", ".join(f"{c:.4g}" for c in overlap.point)
    return (
        f"penetration seen after step {number}, t = {t:.6g} s, at ({at}) between {a!r} and {b!r}: {overlap.depth:.3g} m, "
        f"{100 * overlap.share:.3g} % of the smaller one's extent, where {100 * tolerance:g} % is borne. Contacts were missed or not held: check "
        "the surface pairs and the alert distance, take a smaller step; a witness of another tolerance, or stop=False, bears it"
    )


def _list(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMED} more bodies" if len(names) > _NAMED else ""
    return ", ".join(map(repr, names[:_NAMED])) + more
