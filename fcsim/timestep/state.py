"""The state of a simulation at one time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.assembly.supports import Support
from fcsim.brief import brief, by_fields
from fcsim.errors import MODEL, InputError, expect
from fcsim.ranks import kept_alike

START = 1e-6
"""[rad] Of an angle, and of the model's size: what a start may differ from that of driven rotations."""


@dataclass(frozen=True, eq=False)
class State:
    """t [s]; x (n_dofs,) displacement [m, rad]; v (n_dofs,) velocity [m/s, rad/s]; driven dofs included.

    internal (n_variables,): internal variables of nonlinear materials, None = those at the beginning, see `NonlinearBodies`
    rate, inertia (n_dofs,): what the generalised-alpha scheme keeps beside, the rate of x [m/s, rad/s] and M v' of smooth motion [N, N m]
    """

    t: float
    x: FloatArray
    v: FloatArray
    rate: FloatArray | None = None
    inertia: FloatArray | None = None
    internal: FloatArray | None = None

    __repr__, __reduce__ = brief, by_fields

    @cached_property
    def _kept(self) -> dict[tuple[object, ...], tuple[Model, FloatArray]]:
        return {}

    def kept(self, what: tuple[object, ...], model: Model, made: Callable[[], FloatArray]) -> FloatArray:
        """What `made` gives of this state and a model, read-only: a step asks for its middle configuration eight times, for the loads on it
        five times, and for its momentum as the last step did. What it gives is not to be None, and not to be written to by `made` later."""
        of, values = self._kept.get(what, (None, None))
        if of is not model or values is None:
            values = made()
            values.setflags(write=False)
            if kept_alike():  # what one rank alone keeps it would not come to make with the others, who wait
                self._kept[what] = model, values
        return values

    def let_go(self, what: tuple[object, ...]) -> None:
        """Keep something no longer: nobody asks for it any more in the step that begins here."""
        self._kept.pop(what, None)

    def at(self, t: float) -> State:
        """The state at the time t [s], itself where it is that: h/2 + h/2 may not be h to the last bit."""
        return self if self.t == t else replace(self, t=t)

    def copied(self) -> State:
        """The same state in arrays of its own."""
        rest = (None if values is None else values.copy() for values in (self.rate, self.inertia, self.internal))
        return State(self.t, self.x.copy(), self.v.copy(), *rest)

    def forget(self) -> None:
        """Let go of what is kept: a step that begins here has ended."""
        self._kept.clear()


SPANS = (1e-3, 1e-6, 1e-9, 1e-12)
"""[s] Steps whose rates of driven displacements and angles are tried, the longest first, where no step is told."""
AGREE = 1e-3
"""Of the fastest driven dof: rates by one step and by the next shorter one that differ by less are the motion's."""


def at_rest(model: Model, t: float = 0.0, h: float | None = None) -> State:
    """The reference configuration; driven dofs have the velocity prescribed at t, all others none. h [s]: the step, see `DrivenRotation`;
    None: of `SPANS` the longest that tells what the next one does, so that motions of a microsecond have their own rates.

    InputError where a driven rotation has another angle at t than that of the reference configuration, 0, or a support another
    displacement.
    """
    expect(model, Model, "at_rest, model", MODEL)
    for support in model.supports:
        if isinstance(support, Support) and support.displacement is not None and abs(support.way(t)) > START * _size(model):
            raise InputError(
                f"support of body {support.body!r}: expected the displacement 0 in the reference configuration, got "
                f"{support.way(t):.6g} at t = {t:g} s"
            )
    for turn in model.held.turns:
        angle = turn.source.turned(t)
        if abs(angle) > START:
            raise InputError(
                f"driven rotation of body {turn.source.body!r}: expected the angle 0 in the reference configuration, got {angle:.6g} rad "
                f"at t = {t:g} s"
            )
    return State(t, np.zeros(model.n_dofs), model.of_driven(_driven_velocity(model, t) if h is None else model.driven_velocity(t, h)))


def _driven_velocity(model: Model, t: float) -> FloatArray:
    """Velocities (n_driven,) that supports prescribe, by the longest of `SPANS` that agrees with the next."""
    longer = model.driven_velocity(t, SPANS[0])
    for h in SPANS[1:]:
        v = model.driven_velocity(t, h)
        if np.abs(v - longer).max(initial=0.0) <= AGREE * np.abs(v).max(initial=0.0):
            break
        longer = v
    return longer


def refuse_misplaced(model: Model, state: State) -> None:
    """InputError where an initial state is not one of the model, or has not turned what driven rotations turn."""
    for name, values in (("x", state.x), ("v", state.v)):
        if np.shape(values) != (model.n_dofs,) or not np.isfinite(values).all():
            got = f"shape {np.shape(values)}" if np.shape(values) != (model.n_dofs,) else "NaN or infinity"
            raise InputError(f"initial state, {name}: expected finite numbers of shape {(model.n_dofs,)}, got {got}")
    exact = model.held.placed(state.x, state.t)
    apart = np.abs(model.positions(exact) - model.positions(state.x)).max(initial=0.0)
    if exact is not state.x and apart > START * _size(model):
        raise InputError(
            f"initial state: expected what driven rotations turn where their angles at t = {state.t:g} s say, got it up to "
            f"{apart:.3g} m away"
        )


def _size(model: Model) -> float:
    return float(np.ptp(model.reference, axis=0).max(initial=0.0)) if model.n_nodes else 0.0


def updated(model: Model, state: State, after: State) -> State:
    """The state `after` a step from `state` with the internal variables at its end."""
    bodies = model.nonlinear
    if not bodies:
        return after
    return replace(after, internal=bodies.inner(after.x, state.internal, after.t, after.t - state.t).variables)
