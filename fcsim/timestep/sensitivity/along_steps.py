"""How the states of a run change with its parameters: derivatives carried along the steps.

Let R(p, s, v) = M v - f - H r and g(p, s, v) = H^T v + w be what a step from the state s makes of its unknowns at the parameter p. Along
the direction (1, ds/dp) both are differentiated at the step's own v and r, by central differences of what is assembled, contacts detected
anew included; the rest follows from the implicit function theorem on the contacts' statuses,

    M dv - H dr = -dR,   du = H^T dv + dg,

with the one factorisation of `Result.derivative`. Nothing is solved on the sides, so that no difference goes from one status to another.
Where forces follow v (turning bodies) dR is taken again with v moved by dv, until dv stays. The state at the
end and whatever is measured there are differenced along what came out, and ds/dp goes on into the next step.

Source: the semi-analytical direct method, F. van Keulen, R. T. Haftka, N. H. Kim, "Review of options for structural design sensitivity
analysis. Part 1: Linear systems", Comput. Methods Appl. Mech. Eng. 194, 2005; along steps: M. Kleiber, H. Antúnez, T. D. Hien,
P. Kowalczyk, "Parameter Sensitivity in Nonlinear Mechanics", Wiley, 1997.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.solvers.derivative.bodies import GlobalDerivative
from fcsim.timestep.sensitivity.side import Assembled, Side, built, sides
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.step import Step

RELATIVE = 1e-3
"""Of a parameter: how far to either side what is assembled is differenced. What is smooth is off by its square; round-off counts by its
inverse, where a parameter hardly matters: at 1e-4 that was 5 % of dx/dE of a block that its E moves by 1e-11 of its way."""
SETTLED, ROUND_OFF, ROUNDS = 1e-9, 1e-11, 60
"""Where forces follow v: change of dv from one round to the next over dv, and of v moved by it over v, that is none, in the largest
entries; rounds at the most."""


SECOND_ORDER, SAME = 100.0, 1e-7
"""Times relative^2, and beside it, of the largest velocity or force by which the mean of both sides may differ from the step itself."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How a step changes with one parameter p: derivatives over the unit of p.

    start, state  of the states at its beginning and end: x, v (n_dofs,) and what the scheme keeps beside; t is the step's own
    v (n,)        of the problem's unknowns
    r, u (m,)     of its reactions and velocities, components in the contacts' frames, which may turn with p
    """

    start: State
    state: State
    v: FloatArray
    r: FloatArray
    u: FloatArray
    _sides: tuple[Step | None, Step | None] = field(repr=False)
    _distance: float = field(repr=False)

    __repr__ = brief

    def of[T: (float, FloatArray)](self, measure: Callable[[Step], T]) -> T:
        """The derivative of measure(step), a number or an array, as a case's sensors give; NaN of `penetration`. What is looked at and
        added up after steps (`overlap`, `ledger`) has none.

        InputError where a contact without a reaction is found on one side of the difference alone.
        """
        below, above = self._sides
        if below is None or above is None:
            raise InputError(
                "sensitivity of a measure: expected the same contacts on both sides of the difference, some without a reaction come or go: "
                "take another `relative`"
            )
        return (measure(above) - measure(below)) / (2 * self._distance)


def sensitivities(
    build: Callable[..., Simulation], parameters: Mapping[str, float], *, relative: float = RELATIVE, margin: float | None = None
) -> Iterator[tuple[Step, dict[str, Sensitivity]]]:
    """Run a simulation; yield each step with how it changes with each parameter, as the whole run from its initial state does.

    build       the simulation of the parameters, called by name: build(E=2e9, mu=0.5); the same bodies, meshes and steps for all values.
                Whatever it makes of them counts: materials, friction, loads, motions of supports, initial velocities, sizes
    parameters  their values, by name; each is differenced by `relative` times its size: where one hardly matters, a larger one is better,
                and what two of them agree on is known
    margin      what counts as no reaction or velocity, see `Result.derivative`

    The solver's tol should be 1e-10 or less. InputError where contacts are on the border between two statuses or reactions are not unique
    (see `Result.derivative`), contacts with a reaction come or go within the difference, a step was cut or begins with an impact; for
    links, rolling friction, laws that remember, yield or adhere, materials that are not linear.
    """
    values = _checked(parameters, relative)
    simulation = built(build, values)
    if simulation.linkage is not None or simulation.model.nonlinear:
        what = "links" if simulation.linkage is not None else "bodies of materials that are not linear"
        raise InputError(f"sensitivities: expected a simulation of linear materials without links, got one with {what}")
    pairs = {name: sides(build, values, name, relative * abs(value), simulation) for name, value in values.items()}
    for step in simulation:
        _refuse(step)
        found, solution = {}, _Solution(step, margin)
        for name, pair in pairs.items():
            found[name], ends = _of_step(step, solution, pair, name, relative)
            below, above = (replace(side, start=end, before=step.reactions) for side, end in zip(pair, ends, strict=True))
            pairs[name] = below, above
        yield step, found


@dataclass(frozen=True, eq=False)
class _Solution:
    """The derivative of a step's solution, made where something changes: what rests without a load is on the border of its statuses."""

    step: Step
    margin: float | None

    @cached_property
    def derivative(self) -> GlobalDerivative:
        """InputError where there is none."""
        made = self.step.result.derivative(self.step.reduction, margin=self.margin)
        assert isinstance(made, GlobalDerivative)
        return made

    def change(self, f: FloatArray, w: FloatArray, mu: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(dv, dr, du)."""
        if not (np.any(f) or np.any(w) or np.any(mu * self.step.result.r[:: self.step.contacts.dimension])):
            return np.zeros_like(f), np.zeros_like(w), np.zeros_like(w)
        change = self.derivative.forward(f=f, w=w, mu=mu)
        assert change.v is not None
        return change.v, change.r, change.u


def _checked(parameters: Mapping[str, float], relative: float) -> dict[str, float]:
    """The parameters as numbers; InputError for what is none."""
    if not isinstance(relative, int | float | np.number) or not 0 < relative < 0.1:
        raise InputError(f"relative: expected a number > 0 and < 0.1, got {relative!r}")
    if not isinstance(parameters, Mapping):
        raise InputError(f"parameters: expected values by name, as {{'mu': 0.3}}, got {parameters!r:.80}")
    for name, value in parameters.items():
        if not isinstance(value, int | float | np.number) or not np.isfinite(value) or value == 0:
            raise InputError(f"parameter {name!r}: expected a finite number other than 0, got {value!r} (build may add it to another)")
    return {name: float(value) for name, value in parameters.items()}


def _of_step(
    step: Step, solution: _Solution, pair: tuple[Side, Side], name: str, relative: float
) -> tuple[Sensitivity, tuple[State, State]]:
    """How the step changes, and the states at its end on both sides."""
    problem, distance = step.reduction.problem, pair[1].distance
    r, u, v = step.result.r, step.result.u, step.result.v
    assert v is not None
    dv, dr, du, falls = np.zeros_like(v), np.zeros_like(r), np.zeros_like(r), np.inf
    follows = bool(step.model.elastic.turning or step.model.following)
    for rounds in range(ROUNDS):
        below, above = (side.assembled(step, v + side.distance * dv) for side in pair)
        if not rounds:
            _refuse_changes(step, (below, above), name, relative)
        dR = (above.residual - below.residual) / (2 * distance) - problem.M @ dv
        dg = (above.velocity - below.velocity) / (2 * distance) - problem.H.T @ dv
        last, (dv, dr, du) = dv, solution.change(-dR, dg, (above.mu - below.mu) / (2 * distance))
        moved, before = float(np.abs(dv - last).max(initial=0.0)), falls
        falls = moved
        at_round_off = moved >= 0.5 * before and moved <= ROUND_OFF / distance * np.abs(v).max(initial=0.0)
        if not follows or moved <= SETTLED * np.abs(dv).max(initial=0.0) or at_round_off:
            break
    else:
        raise InputError(f"step {step.number}: the sensitivity to {name!r} does not settle: forces follow the motion too closely")
    lower, upper = (side.ended(step, *(of + side.distance * by for of, by in ((v, dv), (r, dr), (u, du)))) for side in pair)
    start, state = _difference(step, pair[0].start, pair[1].start, distance), _difference(step, lower[0], upper[0], distance)
    return Sensitivity(start, state, dv, dr, du, (lower[1], upper[1]), distance), (lower[0], upper[0])


def _difference(step: Step, below: State, above: State, distance: float) -> State:
    """The derivative of a state from its two sides; rotation vectors of 3D bodies are those of the nearest turn."""

    def of(first: FloatArray | None, last: FloatArray | None) -> FloatArray | None:
        return None if first is None or last is None else (last - first) / (2 * distance)

    lower, model = below.x.copy(), step.model
    if model.dimension == 3 and len(model.rigid):
        own, other = model.rigid_part(lower)[:, 3:], model.rigid_part(above.x)[:, 3:]
        angle = np.linalg.norm(own, axis=1, keepdims=True)
        wrapped = (np.linalg.norm(other - own, axis=1, keepdims=True) > np.pi) & (angle > 0)
        own[:] = np.where(wrapped, own * (1 - 2 * np.pi / np.where(angle > 0, angle, 1.0)), own)
    x, v = (above.x - lower) / (2 * distance), (above.v - below.v) / (2 * distance)
    return State(above.t, x, v, of(below.rate, above.rate), of(below.inertia, above.inertia))


def _refuse(step: Step) -> None:
    """InputError for a step that is more than one problem of Coulomb's law."""
    terms, what = step.encounter.terms, ""
    remembers = step.variables is not None and bool(step.variables.values)
    if step.substeps > 1:
        what = f"one that was cut into {step.substeps} (take a smaller h)"
    elif step.struck is not None:
        what = "one that begins with an impact (take a smaller h)"
    elif isinstance(step.problem, GlobalRollingProblem):
        what = "rolling friction"
    elif remembers or any(part is not None for part in (terms.scale, terms.compliance, terms.adhesion)):
        what = f"the contact law {type(step.scheme.law).__name__} (of those that remember, yield, adhere or are elliptic)"
    if what:
        raise InputError(f"sensitivities, step {step.number}: expected a step of rigid Coulomb contact, got {what}")


def _refuse_changes(step: Step, made: tuple[Assembled, Assembled], name: str, relative: float) -> None:
    """InputError where a contact that bears is missing on a side, or the sides' mean is not the step: what was found ahead of the step's
    end, frames that jump, a build that makes another simulation each time."""
    r_N = step.result.r[:: step.contacts.dimension]
    below, above = made
    for side in made:
        if (lost := np.flatnonzero(~side.present & (r_N > 0))).size:
            bodies = " and ".join(repr(step.model.bodies[body].name) for body in step.contacts.bodies[lost[0]])
            raise InputError(
                f"step {step.number}: a contact of {bodies} that bears is not found at the step's beginning on both sides of the "
                f"difference in {name!r}: take a smaller h or another `relative`"
            )
    both = np.repeat(below.present & above.present, step.contacts.dimension)
    share = SECOND_ORDER * relative**2 + SAME
    held = (step.scheme.right_hand_side(step.model, step.previous), step.support_impulse)  # what f is the difference of where nothing moves
    for what, (lower, upper), expected, sizes in (
        ("velocities", (below.velocity[both], above.velocity[both]), step.result.u[both], (step.result.u, step.reduction.q)),
        ("forces", (below.residual, above.residual), 0.0, (step.problem.f, step.problem.H @ step.result.r, *held)),
    ):
        apart = float(np.abs(0.5 * (lower + upper) - expected).max(initial=0.0))
        size = max(float(np.abs(x).max(initial=0.0)) for x in (*sizes, lower, upper))
        if apart > share * size:
            raise InputError(
                f"step {step.number}: expected a step that is determined by its beginning, got other {what} from the two sides of {name!r} "
                f"(by {apart / size:.1e}): contacts were found ahead within it, frames turned over, or build does not make the same "
                "simulation each time; take a smaller h or a smaller `relative`"
            )
