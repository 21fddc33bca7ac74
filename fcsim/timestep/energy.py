"""The balance of energy of a step: what each scheme's discrete equations say exactly, term by term."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.assembly.kinematics.following import When
from fcsim.assembly.model import Model
from fcsim.assembly.whole.vectors import mass_times
from fcsim.brief import brief
from fcsim.contact_law.law import Breaking
from fcsim.linear.sparse.columns import transposed_times
from fcsim.ranks import shared_out
from fcsim.timestep.state import State


@dataclass(frozen=True, kw_only=True)
class Energy:
    """Energies at the end of a step, and what was exchanged during it; all [J] (2D: J per the model's thickness).

    kinetic, elastic         v.M v / 2 and x.K x / 2 at the end of the step; of nonlinear materials what they store
    contact                  what joints hold at the end of the step: springs, and what cohesion would give back; see `fcsim.contact_law`
    links                    what springs between bodies hold at the end of the step
    link_work                work of the links on the bodies: of joints none but for the scheme's error, which swings about zero; of springs
                             what they give back, less what dashpots take
    load_work                work of gravity and loads
    support_work             work of the supports that drive degrees of freedom
    damping_dissipation      of the Rayleigh damping
    numerical_dissipation    of the time scheme; zero for the theta scheme at theta = 1/2 (joints that break: see `Cohesive`)
    material_dissipation     of the materials: plastic flow, viscosity
    normal_dissipation       minus the work of the normal reactions: what impacts lose
    tangential_dissipation   minus the work of the tangential reactions on the mean velocity; friction is a law of the velocity at the end,
                             so where other forces turn u_T within a step it may give a little back, less the shorter the step
    friction_dissipation     -sum r_T . u_T (and -sum r_R . u_R of rolling moments) with the velocity u_T at the end of the step, of which
                             Coulomb's law speaks: never negative.
                             It differs from tangential_dissipation while u_T changes within the step, and is no term of the balance
    contact_gain             what contacts gave that no joint held: the work of all reactions less what `contact` lost. Friction and impacts
                             make it negative; what is positive was created. No term of the balance
    fracture_dissipation     fracture energy times area of what broke: part of the two above, no term of the balance
    jump_dissipation         of numerical_dissipation what the scheme takes of jumps of velocity by reactions r: (theta - 1/2) r.du, at
                             most all but the loads' part; a rigid impact loses this less contact_gain. No term of the balance
    residual                 change of kinetic + elastic - load_work - support_work - link_work + dissipations but the last two: round-off

    The docstring of each scheme's `energy` has its identity.
    """

    kinetic: float
    elastic: float
    load_work: float
    support_work: float
    damping_dissipation: float
    numerical_dissipation: float
    normal_dissipation: float
    tangential_dissipation: float
    friction_dissipation: float
    residual: float
    contact: float = 0.0
    contact_gain: float = 0.0
    material_dissipation: float = 0.0
    link_work: float = 0.0
    links: float = 0.0
    fracture_dissipation: float = 0.0
    jump_dissipation: float = 0.0

    def with_joints(self, before: float, after: float, breaking: Breaking) -> Energy:
        """The balance where joints held `before` [J] at the beginning and `after` at the end, and some broke."""
        normal, tangential = self.normal_dissipation - breaking.normal, self.tangential_dissipation - breaking.tangential
        return replace(
            self,
            contact=after,
            contact_gain=after - before - normal - tangential,
            normal_dissipation=normal,
            tangential_dissipation=tangential,
            friction_dissipation=self.friction_dissipation - breaking.tangential,
            numerical_dissipation=self.numerical_dissipation + breaking.normal + breaking.tangential,
            fracture_dissipation=breaking.fractured,
        )

    @property
    def at_beginning(self) -> float:
        """Kinetic and elastic energy at the beginning of the step."""
        dissipated = self.damping_dissipation + self.numerical_dissipation + self.material_dissipation
        dissipated += self.normal_dissipation + self.tangential_dissipation
        return self.kinetic + self.elastic - (self.load_work + self.support_work + self.link_work - dissipated + self.residual)

    def then(self, later: Energy) -> Energy:
        """Return the balance over this time and the one that follows: energies of the later, sums of all else."""
        states = ("kinetic", "elastic", "contact", "links")
        sums = {f.name: getattr(self, f.name) + getattr(later, f.name) for f in fields(self) if f.name not in states}
        return replace(later, **sums)


@dataclass(frozen=True)
class Ledger:
    """What contact has created since the simulation began [J].

    supplied  kinetic and elastic energy at the beginning and the amounts of the works of loads and supports since
    gained    sum of `Energy.contact_gain` less what the scheme took of the same jumps, without which a ball that rebounds with
              e > 1 / theta - 1 would be said to make energy; falls as friction and impacts dissipate; lowest: its least value so far
    created   its largest rise above an earlier value: energy that came from nothing. What swings about zero, as the work of a lasting
              contact does in the theta scheme, does not add up
    """

    supplied: float = 0.0
    gained: float = 0.0
    lowest: float = 0.0
    created: float = 0.0
    begun: bool = False

    def after(self, step: Energy) -> Ledger:
        """The ledger after another step."""
        supplied = (self.supplied if self.begun else step.at_beginning) + abs(step.load_work) + abs(step.support_work) + abs(step.link_work)
        gained = self.gained + step.contact_gain - step.jump_dissipation
        lowest = min(self.lowest, gained)
        return Ledger(supplied, gained, lowest, max(self.created, gained - lowest), True)


UNWRITTEN = Ledger()


SHARED_FROM = 15_000
"""Degrees of freedom from which ranks share the terms of a balance out: it then takes more than what they exchange."""


def of_ranks(model: Model, terms: Sequence[tuple[int, Callable[[], FloatArray]]]) -> list[FloatArray]:
    """Terms of a balance, so many numbers each, each by one of the ranks; by every one where a model is small, or its products are
    exchanges."""
    if model.n_dofs < SHARED_FROM or any(group.over_ranks for group in model.groups):
        return [make() for _, make in terms]
    return shared_out("energies", terms)


def momentum(model: Model, state: State) -> FloatArray:
    """M v (n_dofs,) [N s, N m s] of a state, the rigid bodies' inertia as it stands there; kept with it: it ends a step and begins one."""
    return state.kept(("momentum",), model, lambda: mass_times(model, state.v, model.rigid_mass(state.x)))


def turning(model: Model, v0: FloatArray, P0: FloatArray, v1: FloatArray, P1: FloatArray) -> float:
    """G = (v0 . P1 - v1 . P0) / 2 [J] for velocities v and momenta P = M v (n_dofs,) at the beginning and the end of a step.

    Zero for constant M; what the turning of rigid bodies' inertia takes, (v0 + v1) / 2 . (P1 - P0) less the change of v.P / 2: it swings
    about zero, since free rotation makes and takes no energy but for the scheme's error.
    """
    if not model.rigid_bodies.turning:
        return 0.0
    (a, b), (p, q) = ((model.rigid_part(x) for x in pair) for pair in ((v0, v1), (P0, P1)))
    return 0.5 * float(np.sum(a * q - b * p))


def balance(
    *,
    kinetic: tuple[float, float],
    elastic: tuple[float, float],
    loads: float,
    supports: float,
    damping: float,
    numerical: float,
    contact: ContactWork,
    inner: InnerWork,
    jumps: tuple[float, float] = (0.0, 0.0),
) -> Energy:
    """Close the balance; kinetic and elastic energy at the beginning and the end, works and dissipations as in `Energy`; inner: of the
    bodies of nonlinear materials; jumps: the scheme's theta - 1/2, and what the loads would work on the change of velocity [J]."""
    elastic = elastic[0] + inner.stored[0], elastic[1] + inner.stored[1]
    damping, numerical = damping + inner.viscous, numerical + inner.numerical
    change = kinetic[1] - kinetic[0] + elastic[1] - elastic[0]
    return Energy(
        kinetic=kinetic[1],
        elastic=elastic[1],
        load_work=loads,
        support_work=supports,
        damping_dissipation=damping,
        numerical_dissipation=numerical,
        normal_dissipation=-contact.normal,
        tangential_dissipation=-contact.tangential,
        friction_dissipation=contact.friction_dissipation,
        residual=change - loads - supports + damping + numerical + inner.dissipated - contact.normal - contact.tangential,
        material_dissipation=inner.dissipated,
        jump_dissipation=max(min(jumps[0] * contact.jump, numerical - jumps[0] * jumps[1]), 0.0),
    )


@dataclass(frozen=True)
class InnerWork:
    """Of the bodies of nonlinear materials over a step [J]: stored at the beginning and the end, dissipated by the materials, viscous by
    stiffness-proportional damping, numerical: what the work of the inner forces is more than all that."""

    stored: tuple[float, float] = (0.0, 0.0)
    dissipated: float = 0.0
    viscous: float = 0.0
    numerical: float = 0.0


class WithinStep(NamedTuple):
    """When within a step inner forces act: in the configuration x (n_dofs,), the time dt [s] and that share of the way after its
    beginning."""

    x: FloatArray
    dt: float
    share: float


def inner_work(model: Model, before: State, after: State, dx: FloatArray, acting: WithinStep, damped: FloatArray | None) -> InnerWork:
    """The work of a step's inner forces, those at the instant `acting`, on dx (n_dofs,), by what became of it; damped: the velocity
    (n_dofs,) that was damped."""
    bodies = model.nonlinear
    if not bodies:
        return InnerWork()
    x, dt, share = acting
    start = before.x, share
    last = bodies.inner(after.x, before.internal, after.t, after.t - before.t)  # which the step has just ended with
    force = bodies.inner(x, before.internal, before.t + dt, dt, start=start).force
    viscous = 0.0
    if bodies.beta and damped is not None:
        viscous = float(dx @ (bodies.inner(x, before.internal, before.t + dt, dt, v=damped, start=start).force - force))
    first = bodies.inner(before.x, before.internal, before.t, 0.0).energy
    numerical = float(dx @ force) - (last.energy - first) - last.dissipated
    return InnerWork((first, last.energy), last.dissipated, viscous, numerical)


def inner_force(model: Model, before: State, acting: WithinStep, damped: FloatArray) -> FloatArray | float:
    """The inner forces (n_dofs,) [N] of `inner_work`, viscous ones included; 0 without nonlinear bodies."""
    bodies, (x, dt, share) = model.nonlinear, acting
    return bodies.inner(x, before.internal, before.t + dt, dt, v=damped, start=(before.x, share)).force if bodies else 0.0


def pushing(model: Model, x: FloatArray, when: When) -> FloatArray | float:
    """The forces (n_dofs,) [N] of pressures that follow deformable bodies, at the configuration x (n_dofs,); 0 without any."""
    return model.following.force(x, when) if model.following else 0.0


@dataclass(frozen=True)
class ContactWork:
    """Work of the reactions r on the mean velocity: normal and tangential part; -sum r_T . u_T at the end of the step; r on its change."""

    normal: float
    tangential: float
    friction_dissipation: float
    jump: float = 0.0


@dataclass(frozen=True, eq=False)
class Acting:
    """What acted at the contacts of a step: H (n_dofs, m) of all unknowns, r (m,) and the contact law's u (m,); rows a contact: normal
    force, tangential forces, rolling moments."""

    H: sp.csc_array
    r: FloatArray
    u: FloatArray
    rows: int

    __repr__ = brief


def contact_work(acting: Acting, v: FloatArray, change: FloatArray | None = None) -> ContactWork:
    """Work of r on H^T v (m,), v (n_dofs,) the velocity with which the scheme's energy works; rolling counts as tangential. change
    (n_dofs,): that of the velocity over the step."""
    reaction, mean, end = (a.reshape(-1, acting.rows) for a in (acting.r, transposed_times(acting.H, v), acting.u))
    return ContactWork(
        float(reaction[:, 0] @ mean[:, 0]),
        float(np.einsum("ai,ai->", reaction[:, 1:], mean[:, 1:])),
        -float(np.einsum("ai,ai->", reaction[:, 1:], end[:, 1:])),
        0.0 if change is None else float(acting.r @ transposed_times(acting.H, change)),
    )
