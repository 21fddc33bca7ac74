"""What is said of statics that leave for another equilibrium: energy that nothing has taken."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.kinematics.following import When
from fcsim.assembly.model import Model
from fcsim.contact_law import Cohesive, Springs
from fcsim.timestep.energy import pushing
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.remarks.equilibria.drawn_out import DrawnOut
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.step import Step

SHARE = 0.1
"""Of the energy that bodies held before the step: from so much on what is released is named."""

ROUND = 1e-9
"""Of the work of a step: what is less is round-off."""


def _round_off(model: Model, dx: FloatArray) -> float:
    """Round-off [J] of what bodies hold and of a step's work, dx (n_dofs,) its displacements: that of their forces times their size and
    their way. A body that supports carry along is as stressed as its coordinates are rounded."""
    force = model.elastic.largest_force.sum()
    size = float(np.ptp(model.reference, axis=0).max())
    return float(np.finfo(float).eps * force * (size + np.abs(dx[: model.n_elastic]).max(initial=0.0)))


def _damped(scheme: QuasiStatic) -> bool:
    """Whether joints of a law have dashpots along their normals."""
    springs = (getattr(law, "springs", None) for law in single_laws(scheme.law))
    return any(isinstance(each, Springs) and each.normal_damping > 0 for each in springs)


def _broken(step: Step, more: float) -> float:
    """What the fracture of joints took in the step [J], of which they would give back `more` than before at its end."""
    energy = step.energy
    if not energy.fracture_dissipation > 0:
        return 0.0
    return max(min(energy.fracture_dissipation, energy.normal_dissipation) - more, 0.0)


def _given_back(step: Step) -> float:
    """What the force that is left of joints' strength would give back as they close [J]: what they hold, less what glue's springs do."""
    glue, held = [law for law in single_laws(step.scheme.law) if isinstance(law, Cohesive)], step.variables
    if len(glue) != 1 or glue[0].springs is None or held is None or "crack" not in held.values:
        return step.energy.contact
    left = np.sqrt(np.maximum(1 - held.values["fracture"], 0.0))
    return float(np.nansum(glue[0].tension * left * held.values["area"] * held.values["crack"]))


class _Loaded(NamedTuple):
    """The end of a step: its number, the configuration x (n_dofs,), what supports and loads exert there (n_dofs,) [N], the energy [J] that
    bodies and joints hold, and what of it glue would give back as it closes."""

    number: int
    x: FloatArray
    force: FloatArray
    stored: float
    given_back: float


class Snapping:
    """The remark on the first step of statics that snaps: call it with the steps in turn.

    With f the forces of supports and loads at both ends of a step, E what bodies hold, D what friction, fracture and materials take,

        R = (f_0 + f_1) . dx / 2 - (E_1 - E_0) - D

    is of third order in the length of a step along one path of equilibria. Where bodies leave it, through a snap or as a contact lets them
    go, R is what they release, which only motion could carry away. It is named where it exceeds `SHARE` E_0 and |(f_1 - f_0) . dx| / 2,
    which along a path is of second order, and round-off. Friction counts twice, since it is known at the end of the step only; so do
    dashpots of joints. What contacts give back as a pin is drawn out of its hole (`drawn_out`) is none of it. Statics
    regularised by the mass and bodies held by links are not asked.
    """

    def __init__(self) -> None:
        self._before: _Loaded | None = None
        self._drawn_out = DrawnOut()

    def __call__(self, step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark by its kind; {} where there is none, or where it is `said`."""
        model, scheme, x = step.model, step.scheme, step.state.x
        if "snapping" in said or not isinstance(scheme, QuasiStatic) or scheme.eta or step.linked is not None:
            return {}
        force = step.support_impulse + model.load(step.state.t, x) + pushing(model, x, When.at(step.state.t))
        energy = step.energy
        before, self._before = self._before, _Loaded(step.number, x, force, energy.elastic + energy.contact, _given_back(step))
        dx = None if before is None or before.number != step.number - 1 else x - before.x
        back = self._drawn_out(step, dx)
        if before is None or dx is None:
            return {}
        taken = energy.material_dissipation + 2 * max(energy.tangential_dissipation, 0.0)
        taken += 2 * max(energy.normal_dissipation, 0.0) if _damped(scheme) else 0.0
        taken += _broken(step, self._before.given_back - before.given_back)
        work = 0.5 * float((before.force + force) @ dx)
        released = work - (self._before.stored - before.stored) - taken - back
        along = max(0.5 * abs(float((force - before.force) @ dx)), 0.5 * back)
        least = max(ROUND * float(np.abs(before.force * dx).sum()), _round_off(model, dx))
        if not released > max(SHARE * before.stored, along, least):
            return {}
        return {
            "snapping": f"{when}: {released:.3g} J are released that neither supports and loads nor friction and materials account for, "
            f"bodies held {before.stored:.3g} J before: they have left for another equilibrium (a snap, a contact that lets go), which is "
            "one of several that motion may lead to, or the step is too long. Shorter steps tell; dynamics follows it"
        }
