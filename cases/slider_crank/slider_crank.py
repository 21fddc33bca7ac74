"""A slider crank pushes a box over a rough floor: hinges, a slider, and contact with friction in one mechanism.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from fcsim import (
    Ball,
    Body,
    Case,
    Detector,
    Linkage,
    Material,
    Model,
    Sensor,
    Simulation,
    Slider,
    SolverSettings,
    Support,
    SurfacePair,
    Theta,
    build_model,
    contact_surface,
    main,
)
from fcsim.mesh import rectangle, rigid_rectangle

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. The crank turns once from its rearmost position, with `speed` [rad/s] after `ramp` [s]; the
    box stands `ahead` [m] before the slider as it begins."""

    crank: float = 0.1
    rod: float = 0.3
    width: float = 0.02
    slider: tuple[float, float] = (0.06, 0.04)
    box: tuple[float, float] = (0.06, 0.06)
    speed: float = 6.283185307179586
    ramp: float = 0.2
    ahead: float = 0.05
    E: float = 2e9
    nu: float = 0.3
    density: float = 1500.0
    beta: float = 1e-4
    elements: int = 12
    mass: float = 2.0
    mu: float = 0.3
    alert: float = 0.02
    h: float = 2e-3
    theta: float = 0.5
    steps: int = 550
    solver: str = "auto"
    tol: float = 1e-9


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = mechanism(p)
    begin = -p.crank + p.rod
    linkage = Linkage(
        model,
        [
            Ball("crank pin", "crank", "rod", (-p.crank, 0.0)),
            Ball("slider pin", "slider", "rod", (begin, 0.0)),
            Slider("guide", None, "slider", ((begin, 0.0), (begin + p.slider[0] / 4, 0.0))),
        ],
    )
    pairs = [
        SurfacePair(contact_surface(model, [slave]), contact_surface(model, [master]), mu, p.alert, name=name)
        for slave, master, mu, name in ((("box", "y-"), ("floor", "y+"), p.mu, "floor"), (("slider", "x+"), ("box", "x-"), 0.0, "push"))
    ]
    detector, settings = Detector(pairs, model.n_nodes), SolverSettings(name=p.solver, tol=p.tol)
    # crank, rod and slider lie beside each other in planes of their own: that they overlap in this one is meant
    simulation = Simulation(model, detector, Theta(p.h, p.theta), p.steps, settings, linkage=linkage, witness=None)
    slider, box = (model.number[name] - len(model.deformable) for name in ("slider", "box"))
    floor = model.number["floor"]
    return Case(
        name="slider_crank",
        title="slider crank that pushes a box",
        simulation=simulation,
        sensors=(
            Sensor("slider", "way of the slider", "m", lambda s: float(model.rigid_part(s.state.x)[slider, 0])),
            Sensor("formula", "way of the slider by the formula", "m", lambda s: way(p, s.state.t)),
            Sensor("box", "way of the box", "m", lambda s: float(model.rigid_part(s.state.x)[box, 0])),
            Sensor("friction", "friction on the floor", "N", lambda s: float(s.contact_force_on(floor)[0])),
            Sensor("guide", "force of the guide on the slider", "N", lambda s: -float(s.link_force("guide")[1])),
            Sensor("pin", "force in the slider's pin", "N", lambda s: float(np.linalg.norm(s.link_force("slider pin")))),
        ),
        plots={"imposed": "slider", "reaction": ("friction",), "bound": (p.mu * p.mass * GRAVITY, "mu m g")},
        fclib_set="FCSIM_SliderCrank",
        description=f"a flexible rod of {p.elements} cells between two pins, a guided slider and a free box: {model.n_dofs} degrees of "
        f"freedom, {linkage.n_rows} equality constraints",
    )


def speed(p: Parameters, t: float) -> float:
    """Angular velocity of the crank [rad/s], which begins smoothly."""
    return p.speed * (0.5 - 0.5 * float(np.cos(np.pi * t / p.ramp)) if t < p.ramp else 1.0)


def way(p: Parameters, t: float) -> float:
    """x(t) - x(0) of the slider of a rigid mechanism: x = - r cos phi + sqrt(l^2 - r^2 sin^2 phi), phi the integral of `speed`."""
    begun = min(t, p.ramp)
    phi = p.speed * (0.5 * begun - p.ramp / (2 * np.pi) * np.sin(np.pi * begun / p.ramp) + t - begun)
    return float(-p.crank * np.cos(phi) + np.sqrt(p.rod**2 - (p.crank * np.sin(phi)) ** 2) + p.crank - p.rod)


def mechanism(p: Parameters) -> Model:
    """The crank turns about the origin; rod and slider lie along the x axis; the box stands on the floor before the slider."""
    begin, half = -p.crank + p.rod, p.width / 2
    part = rectangle(
        "rod",
        (p.rod, p.width),
        (p.elements, 1),
        Material(p.E, p.nu, p.density),
        plane="stress",
        origin=(-p.crank, -half),
        elements="Q1-enhanced",
    )
    front = begin + p.slider[0] / 2 + p.ahead
    level = -p.slider[1] / 2
    ground = rigid_rectangle("floor", (1.0, 0.1), (front + 0.3, level - 0.05), 1.0)
    return build_model(
        [
            Body("rod", part),
            rigid_rectangle("crank", (2 * p.crank, p.width), (0.0, 0.0), 1.0),
            rigid_rectangle("slider", p.slider, (begin, 0.0), 0.5),
            rigid_rectangle("box", p.box, (front + p.box[0] / 2, level + p.box[1] / 2), p.mass),
            ground,
        ],
        supports=[
            Support("crank", ("x", "y")),
            Support("crank", ("rz",), velocity=lambda t: -speed(p, t)),
            Support("floor", ("x", "y", "rz")),
        ],
        gravity=lambda t: np.array([0.0, -GRAVITY * min(t / p.ramp, 1.0)]),
        beta=p.beta,
    )


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
