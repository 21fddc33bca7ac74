"""What begins with velocities into each other is struck at once: the impact before a run's first step.

Contacts are detected and held at x_m, ahead of the state x by h' v, h' the first part of the step. In the first step of a run, and where
a step is longer than the one before, nothing has held the bodies on the way from x to x_m: what touches and approaches, or turns while it
touches, would lie in each other there, and the law takes such back slowly only. So the velocities v0 of the state are changed first,

    M (v - v0) = H r,   0 <= g(x) + b + h' u_N ⊥ r_N >= 0,   u = H^T v                                                          (1)

by impulses of the step's own law, Coulomb's friction with them, at contacts that touch or would be met on that way; b is the bend by what
turns, see `look_ahead`, found at x + h' v. Momentum is kept, and the energy is what an inelastic impact loses: (v + v0) / 2 . H r. Laws
on velocities meet an impact when it is past, and joints that yield or hold bear what is between: both are left alone.

Velocities of the first state that links forbid are made to agree with them in the same way, with or without contacts: G(x)^T v = 0 by
impulses G l of the links that are kept exactly, of springs none. Of all velocities that agree these are the nearest in the norm of M; their
energy is less by that of the difference, and bodies that nothing else holds keep momentum and moment of momentum. The scheme's own first
step would meet the links opened by h' v, and close them again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.model import Model
from fcsim.linkage import Linkage
from fcsim.timestep.beginning.agreement import forbids, held_at_once, without_contacts
from fcsim.timestep.chain import NOBODY
from fcsim.timestep.encounter import Encounter, LawInput, encounter
from fcsim.timestep.energy import Acting, Energy, contact_work, momentum
from fcsim.timestep.links.linked import Linked
from fcsim.timestep.scheme import Scheme, StepSetup
from fcsim.timestep.state import State
from fcsim.timestep.step import Moment
from fcsim.timestep.step_equation.equation import Answer, Equation, Past
from fcsim.timestep.step_equation.linearisation import Linearisation
from fcsim.timestep.step_equation.look_ahead.ahead import ROUNDS, looked_ahead
from fcsim.timestep.step_equation.look_ahead.lengths import BORNE
from fcsim.timestep.theta import Theta


@dataclass(frozen=True)
class Impact(Theta):
    """(1) as a step of the theta scheme of length h' at theta = 1, in which neither stress nor loads have time to act."""

    theta: float = 1.0

    @property
    def elastic_weight(self) -> float:
        return 0.0

    def factors(self, model: Model) -> tuple[float, float]:
        return 1.0, 0.0

    def right_hand_side(self, model: Model, state: State) -> FloatArray:
        return momentum(model, state)

    def driven(self, model: Model, state: State) -> FloatArray:
        return model.along(state.v)[model.driven_dofs]

    def way(self, model: Model, state: State) -> FloatArray:
        return self.h * state.v

    def moved(self, model: Model, state: State, v: FloatArray) -> State:
        """The state where the step that follows looks for contacts."""
        return replace(state, x=model.advance(state.x, self.h * v), v=v)


@dataclass(frozen=True, eq=False)
class Struck:
    """The state after the impact, and its balance of energy: of no use alone, the stored energies are left out."""

    state: State
    energy: Energy


def struck(
    setup: StepSetup,
    start: Moment,
    linkage: Linkage | None,
    factor: Callable[[Scheme], SystemFactor],
    solve: Callable[[Equation, Past], tuple[Answer | None, Past]],
) -> Struck | None:
    """Return what the impact at the beginning of a step makes of its state; None where there is none, or no answer to it.

    factor: of a scheme's system matrix in the reference configuration; solve: as `solve_equation`. There is no impact in a state that the
    generalised-alpha scheme has left, which moves by more than v.
    """
    model, scheme, state, timing = setup.model, setup.scheme, start.state, setup.scheme.timing
    ahead = timing.h * (1 - timing.theta)
    if state.rate is not None or scheme.way(model, state) is None or not state.v.any():
        return None
    impact = Impact(h=ahead or timing.h, law=scheme.law)
    of_impact = replace(setup, scheme=impact)
    rows = held_at_once(linkage, state)
    forbidden = rows is not None and not start.seen and forbids(rows, model, state)
    if ahead <= 0 and not forbidden:
        return None
    met = encounter(model, setup.detection, impact, state, LawInput(setup.proportions, start.variables, linkage=linkage))
    bent = None
    if ahead <= 0 or not len(met.contacts) or not met.keeps_apart(scheme.law):
        if not forbidden:
            return None
        met = without_contacts(model, impact, state, met)
    else:
        bent = looked_ahead(of_impact, state, met, state.v, impact.moved(model, state, state.v))
        if bent is None and not forbidden and not _approaches(met, impact, state.v):
            return None
    met, past = bent or met, Past((), NOBODY, None)
    rest = impact.right_hand_side(model, state)
    own, elastic = factor(impact).with_rigid_mass(model.rigid_mass(state.x)), Linearisation(impact, model, state)
    looks = 0
    while True:
        answer, past = solve(Equation(impact, model, state, met, own, rest, impact.driven(model, state), elastic, 1.0, rows), past)
        if answer is None:
            return None
        there = impact.moved(model, state, answer.v)
        looking = looks < ROUNDS and len(met.contacts) > 0
        later = looked_ahead(of_impact, state, met, answer.v, there) if looking else None
        if later is None:
            return Struck(replace(state, v=answer.v), _energy(model, state, answer, rows))
        past, looks = past.of_the_same_step(met.contacts, later.contacts, answer.result.r), looks + 1
        met = later


TOLD = 1e-6
"""Of the kinetic energy: what a first impact takes is said from here on."""


def remark(energy: Energy | None) -> tuple[str, ...]:
    """What is said of an impact at the beginning of a run, if there was one."""
    if energy is None:
        return ()
    lost, linked = energy.normal_dissipation + energy.tangential_dissipation, -energy.link_work
    begun = energy.kinetic + lost + linked - energy.support_work
    given = f" and of {energy.support_work:.4g} J that supports gave" if energy.support_work > TOLD * begun else ""
    said = []
    if lost > TOLD * begun:
        said.append(
            "bodies that touch, or would meet within half a step, begin with velocities into each other: they were struck at once, which "
            f"took {lost:.4g} of their {begun:.4g} J{given}, as an inelastic impact does"
        )
    if linked > TOLD * begun:
        said.append(
            "bodies begin with velocities that their links forbid: these were made to agree at once by impulses of the links, which keep "
            f"momentum and moment of momentum and took {linked:.4g} of their {begun:.4g} J{given}"
        )
    return tuple(said)


def _approaches(met: Encounter, impact: Impact, v: FloatArray) -> bool:
    """Whether contacts would be deeper, or closed by more than what is left to the next step, on the way with v (n_dofs,)."""
    gap = met.meeting.contacts.gap
    there = gap + impact.h * (met.H.T @ v).reshape(len(gap), -1)[:, 0]
    return bool((there < np.minimum(gap, 0.0) - BORNE * met.meeting.size).any())


def _energy(model: Model, state: State, answer: Answer, rows: Linked | None) -> Energy:
    """dv . M (v + v0) / 2 = (v + v0) / 2 . (H r + G l + s), s the supports' impulses."""
    met, result = answer.met, answer.result
    mass = model.rigid_mass(state.x)
    mean, change = 0.5 * (answer.v + state.v), model.apply_mass(answer.v - state.v, mass)
    acting = Acting(met.acting_H, met.reaction(result.r), met.velocity(result.u), met.rows)
    work = contact_work(acting, mean)
    linking = np.zeros_like(mean) if rows is None or result.multiplier is None else rows.G @ result.multiplier
    links, impulse = float(mean @ linking), met.impulse(result.r) + linking
    supports, gained = float(mean @ model.driven_share(change - impulse)), work.normal + work.tangential
    kinetic = 0.5 * float(answer.v @ model.apply_mass(answer.v, mass))
    return Energy(
        kinetic=kinetic,
        elastic=0.0,
        load_work=0.0,
        support_work=supports,
        damping_dissipation=0.0,
        numerical_dissipation=0.0,
        normal_dissipation=-work.normal,
        tangential_dissipation=-work.tangential,
        friction_dissipation=work.friction_dissipation,
        residual=float(mean @ change) - supports - links - gained,
        contact_gain=gained,
        link_work=links,
    )
