"""The witness: every few steps the true overlap of the bodies, measured from their skins whatever detection found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, IntArray, is_number
from fcsim.assembly.model import Model
from fcsim.brief import brief, shown
from fcsim.errors import InputError
from fcsim.ranks import held_in_common
from fcsim.witness.overlap import Overlap, PairOverlaps, measure
from fcsim.witness.skin import Skins, skins_of

RESOLUTION = 1e-3
TURN = 0.5
"""[rad] What turns by more in a step may have gone through another body before the next measurement."""
_NAMED = 3
ALLOW = ", or allow it with witness=Witness(initial='allow')"
"""What the users of `fcsim.Simulation` may do besides about bodies that overlap to begin with."""


@dataclass(frozen=True, kw_only=True)
class Witness:
    """When bodies' overlap is measured, and how much of it is borne.

    every      steps between two measurements; the last step, and those in which a rigid body turns by more than `TURN`, are always measured
    tolerance  overlap borne, relative to the smallest extent of the smaller of two bodies; less than a thousandth of it counts as none.
               The law `Velocity` finds an impact when it is past: what approaches by v h a step may overlap by that much
    initial    "refuse": bodies that overlap by more before the first step are an InputError; "allow": each pair may keep what it has then,
               beside the tolerance (a press fit)
    stop       whether a run ends with `fcsim.errors.Penetration` where more is seen; else it is only recorded

    A body is witnessed where its skin is closed: a deformable one always, a rigid one where its named surfaces enclose it; the notes of a
    run name the others. Two bodies that supports hold completely may overlap, and two whose
    contact is left out, see `fcsim.contact_detection.left_out`. Deformable bodies are witnessed with themselves, too.
    """

    every: int = 10
    tolerance: float = 2e-2
    initial: Literal["refuse", "allow"] = "refuse"
    stop: bool = True

    def __post_init__(self) -> None:
        if not (isinstance(self.every, int | np.integer) and is_number(self.every) and self.every >= 1):
            raise InputError(f"Witness, every: expected a whole number of steps >= 1, got {shown(self.every)}")
        if not (is_number(self.tolerance) and self.tolerance > 0):
            raise InputError(f"Witness, tolerance: expected a number > 0, relative to the bodies' size, got {shown(self.tolerance)}")
        if not isinstance(self.stop, bool | np.bool_):
            raise InputError(f"Witness, stop: expected True or False, got {shown(self.stop)}")
        if not isinstance(self.initial, str) or self.initial not in ("refuse", "allow"):
            raise InputError(f"Witness, initial: expected 'refuse' or 'allow', got {shown(self.initial)}")


@dataclass(frozen=True, eq=False)
class Watch:
    """A witness at a model; initial: the overlaps before the first step. See `begin`."""

    witness: Witness
    model: Model
    skins: Skins
    initial: PairOverlaps

    __repr__ = brief

    def in_common(self) -> Watch:
        """The same with its skins, which stay as they are, in memory that ranks have in common. All ranks must ask."""
        return replace(self, skins=held_in_common(self.skins))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the summary of a run says: the bodies, and pairs of them, that are not witnessed."""
        names, said = [body.name for body in self.model.bodies], []
        unseen = [name for name, closed in zip(names, self.skins.closed, strict=True) if not closed]
        if unseen:
            said.append(f"overlap is not witnessed at {_list(unseen)}: surfaces that do not enclose the body")
        if pairs := [tuple(names[k] for k in divmod(int(key), len(names))) for key in self.skins.without[:_NAMED]]:
            more = len(self.skins.without) - len(pairs)
            listed = ", ".join(f"{one!r} and {other!r}" for one, other in pairs) + (f" and {more} more pairs" if more else "")
            said.append(f"overlap is not witnessed between {listed}: their contact is left out")
        return tuple(said)

    def always(self, v: FloatArray, h: float) -> bool:
        """Whether a step h [s] long with the velocities v (n_dofs,) at its end is measured whatever its number: some rigid body that is no
        ball turns by more than `TURN`."""
        model = self.model
        angular = model.rigid_part(v)[:, model.dimension :]
        bodies = np.array([body.shape is None or body.shape.kind != "sphere" for body in model.rigid], dtype=bool)
        return bool(np.any(np.einsum("nk,nk->n", angular, angular)[bodies] * h**2 > TURN**2))

    def look(self, x: FloatArray) -> Overlap:
        """The overlap in the configuration x (n_dofs,): of the pair that exceeds what it is allowed most, relative to its size."""
        seen = measure(self.skins, self.model.positions(x), RESOLUTION * self.witness.tolerance)
        if not len(seen.depth):
            return Overlap()
        size = self._size(seen.bodies)
        excess = (seen.depth - self._allowance(seen.bodies)) / size
        k = int(np.argmax(excess))
        a, b = (self.model.bodies[i].name for i in seen.bodies[k])
        beyond = bool(excess[k] > self.witness.tolerance)
        return Overlap(float(seen.depth[k]), float(seen.depth[k] / size[k]), (a, b), tuple(map(float, seen.point[k])), beyond)

    def _size(self, bodies: IntArray) -> FloatArray:
        return self.skins.size[bodies].min(axis=1, initial=np.inf)

    def _allowance(self, bodies: IntArray) -> FloatArray:
        """Overlap (n,) [m] that pairs of bodies (n, 2) may keep from the beginning."""
        count = len(self.model.bodies)
        keys, wanted = (pairs[:, 0] * count + pairs[:, 1] for pairs in (self.initial.bodies, bodies))
        if self.witness.initial == "refuse" or not len(keys):
            return np.zeros(len(bodies))
        order = np.argsort(keys)
        place = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
        return np.where(keys[place] == wanted, self.initial.depth[place], 0.0)

    def refuse(self) -> None:
        """InputError naming the bodies that overlap before the first step by more than the witness bears."""
        if self.witness.initial == "allow":
            return
        seen, tolerance = self.initial, self.witness.tolerance
        share = seen.depth / self._size(seen.bodies)
        worst = [int(k) for k in np.argsort(-share, kind="stable") if share[k] > tolerance]
        if not worst:
            return
        named = []
        for k in worst[:_NAMED]:
            a, b = (self.model.bodies[i].name for i in seen.bodies[k])
            at = ", ".join(f"{c:.4g}" for c in seen.point[k])
            named.append(f"{a!r} and {b!r} by {seen.depth[k]:.3g} m ({100 * share[k]:.3g} % of the smaller one's extent) at ({at})")
        more = f"; and {len(worst) - _NAMED} more pairs" if len(worst) > _NAMED else ""
        mend = f"Expected at most {100 * tolerance:g} %: move them apart{ALLOW}"
        raise InputError(f"bodies overlap before the first step: {'; '.join(named)}{more}. {mend}")


def begin(witness: Witness, model: Model, x: FloatArray, without: IntArray | None = None) -> Watch:
    """Return the watch over a model from its initial configuration x (n_dofs,) on; without (n, 2): pairs of bodies, the lower number
    first, that may lie in each other, as what joins them stands for their contact.

    InputError naming bodies that overlap there by more than the witness bears, and bodies whose surfaces face inwards.
    """
    skins = skins_of(model)[0]
    if without is not None:
        skins = skins._replace(without=without[:, 0] * len(model.bodies) + without[:, 1])
    watch = Watch(witness, model, skins, measure(skins, model.positions(x), RESOLUTION * witness.tolerance, thorough=True))
    watch.refuse()
    return watch


def penetration_seen(number: int, t: float, overlap: Overlap, tolerance: float, springs: bool = False, late: bool = False) -> str:
    """The message of a run that stops after step `number` at time t [s] for its overlap; springs: whether contacts give way by springs;
    late: whether its law, `Velocity`, finds an impact when it is past."""
    assert overlap.bodies is not None
    a, b = overlap.bodies
    at = ", ".join(f"{c:.4g}" for c in overlap.point)
    why = "The springs of the contact law are too soft for what presses on them, or contacts" if springs else "Contacts"
    if late:
        why = "The law Velocity lets in what approaches by up to its way in a step, which is too long, or contacts"
    return (
        f"penetration seen after step {number}, t = {t:.6g} s, at ({at}) between {a!r} and {b!r}: {overlap.depth:.3g} m, "
        f"{100 * overlap.share:.3g} % of the smaller one's extent, where {100 * tolerance:g} % is borne. {why} were missed or not "
        "held: check the surface pairs and the alert distance, take a smaller step; a witness of another tolerance, or stop=False, bears it"
    )


def _list(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMED} more bodies" if len(names) > _NAMED else ""
    return ", ".join(map(repr, names[:_NAMED])) + more
