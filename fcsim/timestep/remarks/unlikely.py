"""What can be computed with and is hardly meant: friction in per cent, E in GPa, density in g/cm^3, angles in degrees, diagonal pulls,
inertias of no body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.contact_detection import Detection, Detector
from fcsim.contact_law import Rolling, Spinning, Velocity
from fcsim.mesh.part import Body, RigidBody
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

STEEP = 3.0
"""No two solids have more friction than rubber on rough ground, about 1.5."""
SQUEEZED = 0.05
"""Strain under its own weight that a body of small strain cannot have, see `fcsim.timestep.limits`."""
FASTEST = 1.5e4
"""[m/s] Sound runs slower in all solids but diamond and beryllium."""
PASSAGES = 10.0
"""Of sound through a body in a step from which on the body is struck as a rigid one: a block dropped with e = 0.8 on a floor rose again by
0.63 of its fall at 30, 0.60 at 10, 0.37 at 3, 0.13 and 0.24 at 1, 0.56 at 0.3 and 0.60 at 0.1 (0.64 is e^2)."""
INERTIA = 1.01
"""Share beyond which an inertia is that of no body: digits of a table are borne."""
MADE = "rigid_body(body), rigid_box and rigid_solid work it out"
TURNED = 0.2
"""[rad] A driven rotation in one step: contacts would be met at every thirtieth of a turn."""


def steep_friction(detector: Detection) -> Iterator[str]:
    """Coefficients of friction that are none."""
    largest = max(coefficients(detector), default=0.0)
    if largest > STEEP:
        yield (
            f"the coefficient of friction is {largest:g}, an angle of {np.degrees(np.arctan(largest)):.3g} degrees: is it in per cent, or "
            "an angle? mu is the tangent of the angle of friction, between 0 and about 1"
        )


def growing(model: Model, scheme: Scheme, linked: bool) -> Iterator[str]:
    """theta < 1/2: whatever h, a vibration at w [rad/s] grows by ((1 + (h w (1 - theta))^2) / (1 + (h w theta)^2))^(1/2) a step."""
    timing = scheme.timing
    if timing.moving and timing.theta < 0.5 and (model.deformable or linked):
        yield (
            f"theta = {timing.theta:g} lets vibrations grow, stiff ones {(1 - timing.theta) / timing.theta:.3g} times a step, also with "
            "damping: expected theta from 1/2 (which keeps their energy) to 1"
        )


def coefficients(detector: object) -> list[float]:
    """The coefficients that a detector holds as numbers; those of functions are not known before they are asked."""
    if isinstance(detector, Detector):
        given: list[object] = [pair.mu for pair in detector.pairs]
    else:
        mu = getattr(detector, "mu", None)
        given = list(mu.values()) if isinstance(mu, Mapping) else [mu]
    return [float(mu) for mu in given if isinstance(mu, int | float)]


def soft_or_stiff(model: Model, gravity: FloatArray, on_earth: bool) -> Iterator[str]:
    """Young's moduli that do not go with density, size and gravity: a body that its own weight crushes, or in which sound runs faster than
    in any solid (said of SI units alone, which gravity tells)."""
    g = float(np.linalg.norm(gravity))
    for body in model.deformable:
        moduli, density = _moduli(body.part.material), getattr(body.part.material, "density", None)
        if not moduli or not density or g == 0:
            continue
        E = min(moduli)
        strain = density * g * _height(body, gravity / g) / E
        if strain > SQUEEZED:
            yield (
                f"body {body.name!r} (E = {E:g}, density = {density:g}) would be squeezed by {100 * strain:.3g} % under its own weight: "
                "is E in Pa (1 GPa is 1e9 Pa)?"
            )
            return
        E = max(moduli)
        sound = float(np.sqrt(E / density))
        if on_earth and sound > FASTEST:
            yield (
                f"in body {body.name!r} (E = {E:g}, density = {density:g}) sound would run at {sound:.3g} m/s, faster than in any solid: "
                "is the density in kg/m^3 (1 g/cm^3 is 1000 kg/m^3), E in Pa?"
            )
            return


def long_arms(model: Model, scheme: Scheme) -> Iterator[str]:
    """Resistances to rolling and spinning [m] beyond half of what is thinnest of every body that may turn: a body of radius R rests at its
    lever arm mu_r on slopes up to mu_r / R, so that it turns on none."""
    held, extents = _cannot_turn(model), model.extents
    shapes = [body.shape if isinstance(body, RigidBody) else None for body in model.bodies]
    half = [0.5 * extents[k] if shape is None else shape.radius for k, shape in enumerate(shapes) if not held[k]]
    radius = float(max((least for least in half if np.isfinite(least)), default=np.inf))
    for law in single_laws(scheme.law):
        if isinstance(law, Rolling | Spinning) and law.resistance > radius:
            name = type(law).__name__
            yield (
                f"{name}({law.resistance:g}) is a lever arm in m, longer than the radius of any body that can turn, {radius:.3g} m: none "
                f"turns against it. Is it a ratio of arm and radius? {name} takes the ratio times the radius"
            )
            return


def _cannot_turn(model: Model) -> list[bool]:
    """Of each body, whether it is no rigid one or supports drive all that turns it."""
    turns = np.ones(model.n_dofs, dtype=bool)
    turns[model.driven_dofs] = False
    ranges = zip(model.bodies, model.dof_offset, model.dof_offset[1:], strict=False)
    return [isinstance(body, Body) or not turns[begin + model.dimension : end].any() for body, begin, end in ranges]


def _moduli(material: object) -> tuple[float, ...]:
    """Young's moduli > 0 that a material says it has: one, or one along each of its axes."""
    E = getattr(material, "E", None)
    named = E if isinstance(E, tuple) else (E,)
    return tuple(float(value) for value in named if isinstance(value, int | float | np.number) and value > 0)


def _height(body: Body, down: FloatArray) -> float:
    return float(np.ptp(body.points @ down))


def free_to_turn(model: Model, scheme: Scheme) -> Iterator[str]:
    """Of statics: a rigid body that supports keep where it is and let turn, as a floor whose rotations were not thought of."""
    if scheme.timing.moving:
        return
    d, driven = model.dimension, np.zeros(model.n_dofs, dtype=bool)
    driven[model.driven_dofs] = True
    for number, body in enumerate(model.bodies):
        held = driven[model.dof_offset[number] : model.dof_offset[number + 1]]
        if not isinstance(body, Body) and body.shape is None and held[:d].all() and not held[d:].any():
            every = DIRECTIONS[d]
            whole = ", ".join(map(repr, every))
            yield (
                f"rigid body {body.name!r} is held in {', '.join(every[:d])} and free to turn about its centre: in statics nothing but eta "
                f"keeps it from tipping under what is not above that. Support({body.name!r}, ({whole})) holds it whole"
            )
            return


def inertia_of_no_body(model: Model) -> Iterator[str]:
    """Inertias [kg m^2] of rigid bodies that turn which no masses within the body have: the sum of m r^2 is half the trace (in the plane
    the inertia itself), at most m R^2, R to the farthest point; of the principal moments none is more than the two others together."""
    held = _cannot_turn(model)
    for number, body in enumerate(model.bodies):
        if isinstance(body, Body) or held[number] or body.shape is not None or not len(body.points):
            continue
        moments = np.linalg.eigvalsh(body.inertia)
        R = float(np.linalg.norm(body.points - body.centre, axis=1).max())
        polar = float(moments.sum()) / (2 if len(moments) == 3 else 1)
        if polar > INERTIA * body.mass * R**2:
            yield (
                f"body {body.name!r} of {body.mass:.3g} kg has the inertia of a mass at {np.sqrt(polar / body.mass):.3g} m from its "
                f"centre, and no point of it is farther than {R:.3g} m: it would turn too slowly. Is it in kg m^2, about the centre? {MADE}"
            )
            return
        if len(moments) == 3 and moments[2] > INERTIA * (moments[0] + moments[1]):
            yield (
                f"body {body.name!r} has the principal moments of inertia {', '.join(f'{moment:.3g}' for moment in moments)} kg m^2: of no "
                f"body is the largest more than the two others together. {MADE}"
            )
            return


def fast_turning(model: Model, scheme: Scheme, begin: float, steps: int) -> Iterator[str]:
    """Driven rotations by more than contacts can follow in one step."""
    times = np.linspace(begin, begin + steps * scheme.h, 6)[:-1]
    for support in model.supports:
        if not isinstance(support, DrivenRotation) or not steps:
            continue
        turned = max(abs(support.turned(float(t) + scheme.h) - support.turned(float(t))) for t in times)
        if turned > TURNED:
            yield (
                f"body {support.body!r} is turned by {turned:.3g} rad, {np.degrees(turned):.3g} degrees, in one step: is the angle in "
                "degrees? Angles are in radians (numpy.radians); if it is right, choose a smaller h"
            )
            return


def restitution_of_points(model: Model, scheme: Scheme) -> Iterator[str]:
    """A coefficient of restitution on a free deformable body that swings within the steps: it rebounds by its waves, and by h."""
    restitution = scheme.law.restitution if scheme.timing.moving and isinstance(scheme.law, Velocity) else 0.0
    if restitution == 0:
        return
    held = {support.body for support in model.supports}
    for body, extent in zip(model.deformable, model.extents.tolist(), strict=False):
        moduli, density = _moduli(body.part.material), getattr(body.part.material, "density", None)
        if body.name in held or not moduli or not density:
            continue
        passage = float(extent / np.sqrt(max(moduli) / density))
        if scheme.h < PASSAGES * passage:
            yield (
                f"restitution {restitution:g} is that of the points that touch: of body {body.name!r}, through which sound takes "
                f"{passage:.2g} (h = {scheme.h:g}), waves decide how far it rebounds, and steps of about that length take most of it. "
                f"{restitution:g} is the body's where it is rigid, or h at least {PASSAGES * passage:.2g}"
            )
            return


def diagonal_pull(model: Model, scheme: Scheme, begin: float, steps: int) -> Iterator[str]:
    """Supports that move several directions, each at the same velocity: along a diagonal, or turning as fast in rad/s as they go in m/s."""
    times = np.linspace(begin, begin + steps * scheme.h, 6)
    for support in model.supports:
        if not isinstance(support, Support) or len(support.directions) < 2:
            continue
        fastest = max((support.speed(float(t)) for t in times), key=abs)
        if fastest:
            *others, last = support.directions
            yield (
                f"support of body {support.body!r} moves each of {', '.join(others)} and {last} at {fastest:.3g}: velocity is that of "
                f"every direction named. To move one and hold the others: Support({support.body!r}, ({support.directions[0]!r},), "
                "velocity=...) and a second Support with the others"
            )
            return


def unused_velocities(model: Model, scheme: Scheme, state: State) -> Iterator[str]:
    """Where statics begin with velocities in the reference configuration: no equation has them. States that an earlier run of statics ended
    with have moved, and have its increments over h as velocities."""
    if scheme.timing.moving or state.x.any():
        return
    free = np.abs(state.v - model.driven_share(state.v))
    fastest = int(np.argmax(free)) if len(free) else 0
    if not len(free) or free[fastest] <= 1e-9 * np.abs(state.v).max():
        return
    body = model.bodies[int(np.searchsorted(model.dof_offset, fastest, side="right")) - 1].name
    yield (
        f"the initial velocities, of {body!r} up to {free[fastest]:.3g} m/s or rad/s, are not used: statics have none. What helps: a "
        "scheme of motion, as Theta(h=...), or a load or a driven support that moves the body"
    )
