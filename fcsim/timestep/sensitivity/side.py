"""One side of a difference: what a step of a simulation at another value of a parameter makes of given unknowns."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem
from fcsim.timestep.encounter import Encounter, LawInput, encounter
from fcsim.timestep.reactions.drift import drift_of
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.equation import Answer, Equation
from fcsim.timestep.step_equation.linearisation import Linearisation


@dataclass(frozen=True, eq=False)
class Assembled:
    """A step's equation at unknowns v (n_dofs,), with what is left of it for the contacts of the step that is differenced.

    residual (n,)  M v - f - H r; velocity (m,): H^T v + w; mu (nc,)
    rows (k,)      which unknowns of `problem` are those contacts', which of those contacts it has: present (nc,)
    """

    equation: Equation
    problem: GlobalProblem
    load: FloatArray
    v: FloatArray
    residual: FloatArray
    velocity: FloatArray
    mu: FloatArray
    rows: IntArray
    present: BoolArray

    def reaction(self, r: FloatArray) -> FloatArray:
        """r (m,) of the step that is differenced in the order of this problem."""
        own = np.zeros(self.problem.m)
        own[self.rows] = r[np.repeat(self.present, self.equation.met.contacts.dimension)]
        return own


@dataclass(frozen=True, eq=False)
class Side:
    """The simulation at p + distance, the state there at the beginning of the step, and the reactions of the step before."""

    simulation: Simulation
    distance: float
    start: State
    before: Reactions | None = None

    @classmethod
    def of(cls, build: Callable[..., Simulation], values: Mapping[str, float], name: str, distance: float) -> Side:
        """The side of the parameter `name`, at its initial state."""
        simulation = built(build, {**values, name: values[name] + distance})
        return cls(simulation, distance, simulation.initial or at_rest(simulation.model, h=simulation.scheme.h))

    @cached_property
    def _elastic(self) -> Linearisation:
        return Linearisation(self.simulation.scheme, self.simulation.model, self.start)

    @cached_property
    def _rest(self) -> FloatArray:
        return self.simulation.scheme.right_hand_side(self.simulation.model, self.start)

    @cached_property
    def _rigid_mass(self) -> FloatArray:
        return self.simulation.scheme.rigid_mass(self.simulation.model, self.start, self._rest)

    @cached_property
    def _met(self) -> Encounter:
        """The contacts of the step, which its unknowns do not change."""
        s = self.simulation
        told = LawInput(s.substeps.proportions, None, drift=drift_of(s.scheme, s.model, self.before))
        return encounter(s.model, s.substeps.detection, s.scheme, self.start, told)

    @cached_property
    def _equation(self) -> Equation:
        s = self.simulation
        factor = s.substeps.system(s.scheme).with_rigid_mass(self._rigid_mass).turned(self._elastic.rotation)
        driven = s.scheme.driven(s.model, self.start)
        return Equation(s.scheme, s.model, self.start, self._met, factor, self._rest, driven, self._elastic, 1.0)

    def _velocity(self, unknown: FloatArray) -> FloatArray:
        """v (n_dofs,) in world axes from a problem's unknowns, with what drives this side's supports."""
        model = self.simulation.model
        v = np.empty(model.n_dofs)
        v[model.free_dofs] = unknown if model.driven == "eliminated" else unknown[model.free_dofs]
        v[model.driven_dofs] = self.simulation.scheme.driven(model, self.start)
        return model.world(v)

    def assembled(self, step: Step, unknown: FloatArray) -> Assembled:
        """The step's equation at its unknowns (n,) for the contacts and reactions of `step`."""
        v, equation = self._velocity(unknown), self._equation
        iterate = self._elastic.first if self._elastic.rotation is None else v  # what is linear in v is in M
        load = self._rest - self._elastic.term(iterate) + self._elastic.push(iterate)
        problem = equation.problem(load)
        assert isinstance(problem, GlobalProblem)
        contacts, d = equation.met.contacts, step.contacts.dimension
        present, at = _found(step.contacts.identity, contacts.identity)
        rows: IntArray = (d * at[:, None] + np.arange(d)).ravel()
        velocity, mu, r = np.zeros((len(present), d)), step.contacts.mu.copy(), np.zeros(problem.m)
        velocity[present] = (problem.H.T @ unknown + problem.w)[rows].reshape(-1, d)
        mu[present] = contacts.mu[at]
        r[rows] = step.result.r[np.repeat(present, d)]
        residual = problem.M @ unknown - problem.f - problem.H @ r
        return Assembled(equation, problem, load, v, residual, velocity.ravel(), mu, rows, present)

    def ended(self, step: Step, unknown: FloatArray, r: FloatArray, u: FloatArray) -> tuple[State, Step | None]:
        """The state at the end for unknowns (n,), reactions and velocities (m,), and the whole step, without what is looked at and added up
        after it (penetration, overlap); None where its contacts are others than those of `step`."""
        s, made = self.simulation, self.assembled(step, unknown)
        met = made.equation.met
        impulse = met.impulse(made.reaction(r))
        after = s.scheme.advance(s.model, self.start, made.v, impulse, self._rigid_mass)
        if not np.array_equal(met.contacts.identity, step.contacts.identity):
            return after, None
        result = replace(step.result, r=r, u=u, v=unknown)
        answer = Answer(made.problem, step.reduction, result, made.v, made.load, step.start, made.equation.factor, met)
        whole = replace(
            step,
            model=s.model,
            scheme=s.scheme,
            previous=self.start,
            state=after,
            contacts=met.contacts,
            H=met.H,
            problem=made.problem,
            result=result,
            encounter=met,
            support_impulse=s.substeps.support_impulse(s.scheme, answer, impulse, self._rigid_mass, after),
            last=None,
            penetration=np.nan,
            overlap=None,
        )
        return after, whole


def _found(wanted: IntArray, among: IntArray) -> tuple[BoolArray, IntArray]:
    """Which of `wanted` (nc,) are in `among`, and where those are."""
    order = np.argsort(among, kind="stable")
    at = np.searchsorted(among[order], wanted)
    present = at < len(among)
    present[present] = among[order[at[present]]] == wanted[present]
    return present, order[at[present]]


def sides(build: Callable[..., Simulation], values: Mapping[str, float], name: str, distance: float, base: Simulation) -> tuple[Side, Side]:
    """Both sides of a parameter; InputError where they are not of the base's meshes, bodies and steps."""
    pair = Side.of(build, values, name, -distance), Side.of(build, values, name, distance)
    for side in pair:
        other, at = side.simulation, f"{values[name] + side.distance:g}"
        if other.model.n_dofs != base.model.n_dofs:
            raise InputError(
                f"parameter {name!r}: expected the same meshes for all values, got {other.model.n_dofs} degrees of freedom at {at} and "
                f"{base.model.n_dofs} at {values[name]:g}"
            )
        if (other.scheme.h, other.steps) != (base.scheme.h, base.steps):
            raise InputError(
                f"parameter {name!r}: expected the same steps for all values, got {other.steps} of {other.scheme.h:g} s at {at} and "
                f"{base.steps} of {base.scheme.h:g} s at {values[name]:g}"
            )
    return pair


def built(build: Callable[..., Simulation], values: Mapping[str, float]) -> Simulation:
    """What `build` makes of the values; InputError where that is no simulation or it does not take these names."""
    try:
        inspect.signature(build).bind(**values)
    except TypeError as error:
        raise InputError(f"build: expected a function of {', '.join(values)}: {error}") from None
    simulation: object = build(**values)
    if not isinstance(simulation, Simulation):
        raise InputError(f"build: expected it to return a Simulation, got {type(simulation).__name__}")
    return simulation
