"""An elastic bar flies against a rigid wall, stays in contact while a wave runs to its free end and back, and flies off again.

The case SDNV100 of code_aster: laterally held, so that the exact solution is that of waves of pressure in one dimension. See README.md
beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcsim import (
    Body,
    Case,
    Detector,
    Gap,
    GeneralisedAlpha,
    History,
    InputError,
    Limits,
    Material,
    Model,
    Scheme,
    Sensor,
    Simulation,
    SolverSettings,
    Step,
    Support,
    SurfacePair,
    Theta,
    Velocity,
    at_rest,
    build_model,
    contact_surface,
    main,
)
from fcsim.mesh import brick, rigid_box


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. `--set name=value` changes one."""

    length: float = 0.2
    side: float = 0.02
    elements: int = 80
    elements_across: int = 1
    E: float = 2e11
    nu: float = 0.3
    density: float = 8000.0
    speed: float = 100.0
    gap: float = 2e-3
    scheme: Literal["theta", "generalised-alpha"] = "theta"
    theta: float = 0.5
    rho: float = 0.5
    law: Literal["gap", "velocity"] = "gap"
    restitution: float = 0.0
    lumped: bool = True
    courant: float = 0.5
    steps: int = 0
    solver: str = "NSN-AC"
    tol: float = 1e-8


@dataclass(frozen=True)
class ExactSolution:
    """Waves of pressure: contact from gap / v0 for 2 L / c, with the pressure rho c v0; then all of the bar flies with -v0."""

    p: Parameters

    @property
    def wave_speed(self) -> float:
        """c_p = sqrt(E (1 - nu) / (rho (1 + nu) (1 - 2 nu))) [m/s]."""
        p = self.p
        return float(np.sqrt(p.E * (1 - p.nu) / (p.density * (1 + p.nu) * (1 - 2 * p.nu))))

    @property
    def start(self) -> float:
        return self.p.gap / self.p.speed

    @property
    def end(self) -> float:
        return self.start + 2 * self.p.length / self.wave_speed

    @property
    def force_in_contact(self) -> float:
        """rho c v0 A [N]."""
        return self.p.density * self.wave_speed * self.p.speed * self.p.side**2

    @property
    def impact_energy(self) -> float:
        """rho A L v0^2 / 2 [J]."""
        return 0.5 * self.p.density * self.p.side**2 * self.p.length * self.p.speed**2

    def force(self, t: ArrayLike) -> NDArray[np.float64]:
        """Contact force [N] at the times t [s]."""
        return np.where((np.asarray(t) > self.start) & (np.asarray(t) <= self.end), self.force_in_contact, 0.0)

    def mean_velocity(self, t: ArrayLike) -> NDArray[np.float64]:
        """Velocity [m/s] of the centre of mass, towards the wall: from v0 linearly to -v0 during the contact."""
        return np.interp(np.asarray(t, dtype=np.float64), [self.start, self.end], [self.p.speed, -self.p.speed])

    def elastic_energy(self, t: ArrayLike) -> NDArray[np.float64]:
        """Elastic energy [J]: grows to all of the impact's at half of the contact's time, and back to none."""
        middle = 0.5 * (self.start + self.end)
        return np.interp(np.asarray(t, dtype=np.float64), [self.start, middle, self.end], [0.0, self.impact_energy, 0.0])


def build(p: Parameters) -> Case:
    """Return the case with the given parameters; steps = 0: up to 1.4 times the time at which the bar leaves."""
    if not (p.speed > 0 and p.courant > 0 and p.gap >= 0):
        raise InputError(f"case impact_bar: expected speed > 0, courant > 0 and gap >= 0, got {p.speed}, {p.courant} and {p.gap}")
    exact = ExactSolution(p)
    h = p.courant * p.length / p.elements / exact.wave_speed
    model = bar_and_wall(p)
    initial = at_rest(model)
    initial.v[: model.n_elastic : 3] = -p.speed
    pair = SurfacePair(contact_surface(model, [("bar", "x-")]), contact_surface(model, [("wall", "x+")]), 0.0, p.gap)
    floor = 1e-3 * p.speed
    simulation = Simulation(
        model,
        Detector([pair], model.n_nodes),
        scheme(p, h),
        p.steps or round(1.4 * exact.end / h),
        SolverSettings(name=p.solver, tol=p.tol, floor=floor),
        initial,
        limits=Limits(strain=np.inf),  # the wave equation is linear at any strain, also at 1/3 with the data of Doyen et al.
    )
    bar = model.number["bar"]
    mass = p.density * p.side**2 * p.length

    def velocity(step: Step) -> float:
        return -float(model.apply_mass(step.state.v)[: model.n_elastic : 3].sum()) / mass

    return Case(
        name="impact_bar",
        title=f"Impacting elastic bar, {p.scheme}, law {p.law}",
        simulation=simulation,
        sensors=(
            Sensor("force", "contact force", "N", lambda step: float(step.contact_force_on(bar)[0])),
            Sensor("exact_force", "exact", "N", lambda step: float(exact.force(step.state.t - 0.5 * h))),
            Sensor("velocity", "velocity of the centre of mass, towards the wall", "m/s", velocity),
            Sensor("exact_velocity", "exact", "m/s", lambda step: float(exact.mean_velocity(step.state.t))),
            Sensor("exact_elastic", "elastic energy, exact", "J", lambda step: float(exact.elastic_energy(step.state.t))),
        ),
        plots={"histories": (History("force", ("force", "exact_force")), History("velocity", ("velocity", "exact_velocity")))},
        fclib_set="FCSIM_ImpactBar",
        description=f"an elastic bar of {p.elements} x {p.elements_across} x {p.elements_across} hexahedra against a rigid wall",
    )


def scheme(p: Parameters, h: float) -> Scheme:
    law = Gap() if p.law == "gap" else Velocity(p.restitution)
    return Theta(h, p.theta, law) if p.scheme == "theta" else GeneralisedAlpha(h, p.rho, law)


def bar_and_wall(p: Parameters) -> Model:
    """The bar along x, laterally held, flies along -x against a held wall."""
    divisions = (p.elements, p.elements_across, p.elements_across)
    part = brick("bar", (p.length, p.side, p.side), divisions, Material(p.E, p.nu, p.density), origin=(p.gap, 0.0, 0.0))
    wall = rigid_box("wall", (p.side, 3 * p.side, 3 * p.side), (-0.5 * p.side, 0.5 * p.side, 0.5 * p.side), 1.0)
    return build_model(
        [Body("bar", part), wall],
        supports=[Support("bar", ("y", "z")), Support("wall", ("x", "y", "z", "rx", "ry", "rz"))],
        lumped=p.lumped,
    )


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
