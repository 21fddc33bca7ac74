"""What is said as a run begins: mistakes that give numbers all the same, each with its mend. Remarks, no errors: what is meant is done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, Detector
from fcsim.contact_detection.never_touching import never_touching
from fcsim.linkage import Linkage
from fcsim.mesh.part import Body, RigidBody
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.links.mechanisms import mechanisms
from fcsim.timestep.links.undetermined import undetermined_forces
from fcsim.timestep.remarks.falling import falling
from fcsim.timestep.remarks.locked_joints import locked_joints
from fcsim.timestep.remarks.of_laws.begun_anew import begun_anew
from fcsim.timestep.remarks.of_laws.coarse_glue import coarse_glue
from fcsim.timestep.remarks.of_shapes.uneven_faces import uneven_faces
from fcsim.timestep.remarks.over_time.lost_pulses import lost_pulses
from fcsim.timestep.remarks.over_time.undersampled import undersampled
from fcsim.timestep.remarks.pieces import hanging_nodes, torn_meshes
from fcsim.timestep.remarks.unlikely import (
    diagonal_pull,
    fast_turning,
    free_to_turn,
    growing,
    inertia_of_no_body,
    long_arms,
    restitution_of_points,
    soft_or_stiff,
    steep_friction,
    unused_velocities,
)
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

EARTH = (9.5, 10.1)
"""[m/s^2] What is taken for the gravity of the Earth in SI units; a thousand times that, for it in millimetres."""
NO_SOLID, DENSEST = 0.5, 3e4
"""[kg/m^3] Lighter than aerogels, heavier than osmium."""
HUGE = 50.0
"""[m] The thickness of no usual body."""
FALL = 0.5
"""Of the smallest body's thickness: a fall in one step, from rest, that is too far."""
TOUCH, FACE = 1e-3, 0.1
"""Of the smaller body: bodies touch whose boxes are so near along one axis, and share so much along the others."""
_MANY = 2000
"""Bodies from which on pairs of them are not compared."""


UNRESOLVED = 1e-2
"""Errors that pass for none, relative to the fall in a step, from which on it is said."""


def opening_remarks(
    model: Model, detector: Detection, scheme: Scheme, state: State, steps: int, linkage: Linkage | None, *settings: SolverSettings
) -> tuple[str, ...]:
    """Remarks on a simulation before its first step at `state`; linkage: its links, which hold and join bodies too; settings:
    the solver's as they were given and as they are with a floor."""
    linked = linkage is not None
    positions = model.positions(state.x)
    seen = _gravities(model, state.t, state.t + steps * scheme.h)
    gravity = max(seen, key=lambda g: float(np.linalg.norm(g)))
    upwards = tuple(_upwards(model, positions, gravity, linked))
    found: list[Iterable[str]] = [_units(model, gravity), upwards, _long_steps(model, scheme, gravity)]
    found += [_coarse_floor(model, scheme, gravity, *settings), steep_friction(detector), fast_turning(model, scheme, state.t, steps)]
    found += [diagonal_pull(model, scheme, state.t, steps), undersampled(model, scheme, state.t, steps)]
    found.append(lost_pulses(model, scheme, state.t, steps))
    found += [restitution_of_points(model, scheme), growing(model, scheme, linked)]
    found.append(soft_or_stiff(model, gravity, EARTH[0] <= float(np.linalg.norm(gravity)) <= EARTH[1]))
    found += [torn_meshes(model), hanging_nodes(model), inertia_of_no_body(model), long_arms(model, scheme)]
    found += [unused_velocities(model, scheme, state), begun_anew(scheme, state), coarse_glue(model, scheme, detector, positions)]
    if linkage is not None:
        found += [locked_joints(model, linkage, detector, positions), mechanisms(model, linkage, scheme, state)]
        found.append(undetermined_forces(model, linkage, state))
    if not linked:
        found.append(free_to_turn(model, scheme))
    if not linked and not upwards:
        usual: FloatArray = np.median(seen, axis=0)  # ground that shakes may be the largest for a moment: nothing falls that way
        found.append(falling(model, state, scheme, usual, steps, _held(model)))
    if isinstance(detector, Detector):
        names = [body.name for body in model.bodies]
        found += [never_touching(detector.pairs, positions, names), uneven_faces(detector.pairs, names, len(model.deformable))]
        if not linked:
            found += [_alone(model, detector, gravity), _forgotten(model, detector, positions)]
    return tuple(chain.from_iterable(found))


def _gravities(model: Model, begin: float, end: float) -> list[FloatArray]:
    """The accelerations (d,) [m/s^2] of gravity at the run's beginning and end and between."""
    return [model.gravity_at(float(t)) for t in np.linspace(begin, end, 5)]


def _points(model: Model, positions: FloatArray) -> list[FloatArray]:
    return np.split(positions, model.node_offset[1:-1])


def _densities(model: Model) -> FloatArray:
    """[kg/m^3] Of the bodies, those known; of rigid ones at most, that of a body which fills its box, not of those that supports keep where
    they are, whose mass may be any."""
    found, driven = [], np.zeros(model.n_dofs, dtype=bool)
    driven[model.driven_dofs] = True
    for body, first in zip(model.bodies, model.dof_offset.tolist(), strict=False):
        if isinstance(body, RigidBody) and driven[first : first + model.dimension].all():
            continue
        if isinstance(body, Body):
            density = getattr(body.part.material, "density", None)
        else:
            density = body.mass / max(float(np.prod(np.ptp(body.points, axis=0))), 1e-300) if len(body.points) else None
        if density is not None and density > 0:
            found.append(float(density))
    return np.array(found)


def _units(model: Model, gravity: FloatArray) -> Iterator[str]:
    """Lengths, densities and gravity of different systems of units: forces are then wrong by powers of ten."""
    g, densities = float(np.linalg.norm(gravity)), _densities(model)
    if not densities.size or g == 0:
        return
    typical = float(np.median(densities))
    on_earth, in_mm = EARTH[0] <= g <= EARTH[1], 1e3 * EARTH[0] <= g <= 1e3 * EARTH[1]
    deformable = bool(model.deformable)
    if on_earth and typical < 1e-5 and deformable:
        yield (
            f"gravity is {g:.4g}, as in m/s^2, and densities are {typical:.3g}, as in tonnes per mm^3: with millimetres, tonnes and MPa "
            "gravity is 9810 mm/s^2; with metres, kg and Pa densities are in kg/m^3"
        )
    elif in_mm and NO_SOLID < typical < DENSEST and deformable:
        yield (
            f"gravity is {g:.4g}, as in mm/s^2, and densities are {typical:.3g}, as in kg/m^3: with metres gravity is 9.81 m/s^2; with "
            "millimetres, tonnes and MPa densities are in t/mm^3 (2000 kg/m^3 is 2e-9)"
        )
    elif on_earth and typical > DENSEST and deformable:
        yield f"densities are {typical:.3g}, more than of any solid in kg/m^3, and gravity is {g:.4g} m/s^2: are they in kg/m^3?"
    elif on_earth and typical > NO_SOLID and (thick := float(np.median(model.extents[np.isfinite(model.extents)]))) > HUGE:
        yield (
            f"bodies are {thick:.3g} m thick, and gravity is {g:.4g} m/s^2: are lengths in millimetres? "
            "Give them in metres (gmsh scales what it saves by Mesh.ScalingFactor), or gravity in mm/s^2"
        )


def _held(model: Model) -> BoolArray:
    """(nb,) Bodies that a support names."""
    held = np.zeros(len(model.bodies), dtype=bool)
    for support in model.supports:
        held[model.body_number(support.body)] = True
    return held


def _upwards(model: Model, positions: FloatArray, gravity: FloatArray, linked: bool) -> Iterator[str]:
    """Gravity along the last axis, upwards, that draws free bodies away from those that are held."""
    g, held = float(np.linalg.norm(gravity)), _held(model)
    if linked or g == 0 or gravity[-1] < 0.9 * g or held.all() or not held.any():
        return
    centres = np.array([points.mean(axis=0) for points in _points(model, positions)])
    if (centres[~held].mean(axis=0) - centres[held].mean(axis=0)) @ gravity > 0:
        axis = "xyz"[model.dimension - 1]
        yield (
            f"gravity is {gravity.round(6).tolist()}, along +{axis}, away from the bodies that supports hold: free bodies rise. Downwards "
            f"its last component is negative, {(-np.abs(gravity[-1])).round(6)}"
        )


def _long_steps(model: Model, scheme: Scheme, gravity: FloatArray) -> Iterator[str]:
    """Steps in which a body at rest falls by much of its own thickness: contacts come and go unseen, and friction acts late."""
    thickness = float(model.extents.min(initial=np.inf))
    g, h = float(np.linalg.norm(gravity)), scheme.h
    if scheme.timing.moving and np.isfinite(thickness) and g * h**2 > FALL * thickness > 0:
        yield (
            f"in one step of h = {h:.3g} s a body falls by {g * h**2:.3g} m, and the thinnest is {thickness:.3g} m thick: choose h below "
            f"{np.sqrt(0.01 * thickness / g):.2g} s"
        )


def _coarse_floor(model: Model, scheme: Scheme, gravity: FloatArray, *settings: SolverSettings) -> Iterator[str]:
    """A floor of the errors beside which bodies are small: motions of tol times it pass for none. One beside which their fall is small."""
    if not settings:
        return
    (given, used), moving = settings, scheme.timing.moving
    extents = [float(np.ptp(points, axis=0).max()) for points in _points(model, model.reference) if len(points)]
    smallest, unit = min(extents, default=np.inf), "m/s" if moving else "m"
    passed = used.least_motion * (scheme.h if moving else 1.0)
    if given.floor is not None and passed > smallest > 0:
        yield (
            f"errors of solvers are measured against motions of at least {passed:.3g} m a step (SolverSettings.floor = {given.floor:g} "
            f"{unit}), and the smallest body is {smallest:.3g} m: leave floor out, or give a thousandth of the motion in a step, in {unit}"
        )
    fall, none = float(np.linalg.norm(gravity)) * scheme.h**2, used.tol * passed
    if moving and none > UNRESOLVED * fall > 0:
        yield (
            f"in one step of h = {scheme.h:.3g} s a body at rest falls by {fall:.3g} m, and errors of {none:.2g} m pass for none, so that "
            f"forces of bodies at rest are known to {100 * min(none / fall, 1.0):.2g} %: choose a larger h"
        )


def _alone(model: Model, detector: Detector, gravity: FloatArray) -> Iterator[str]:
    """Bodies that no support, no pair and no link names, while gravity acts."""
    named = _held(model)
    for pair in detector.pairs:
        for surface in (pair.slave, pair.master):
            named[np.unique(surface.bodies)] = True
    alone = [body.name for body, is_named in zip(model.bodies, named, strict=True) if not is_named]
    if alone and np.any(gravity):
        more = f" and {len(alone) - 1} more" if len(alone) > 1 else ""
        yield f"body {alone[0]!r}{more}: no support holds it and no pair of surfaces names it, so that it falls through all others"


def _forgotten(model: Model, detector: Detector, positions: FloatArray) -> Iterator[str]:
    """Bodies that touch with faces along the axes, of which one can move, and that no pair names together."""
    count = len(model.bodies)
    if not 1 < count <= _MANY:
        return
    boxes = [(points.min(axis=0), points.max(axis=0)) for points in _points(model, positions)]
    low, high = np.array([box[0] for box in boxes]), np.array([box[1] for box in boxes])
    extent = high - low
    first, second = np.triu_indices(count, 1)
    # how far the boxes reach into each other along each axis, < 0: apart; of the smaller body's extent
    into, smaller = np.minimum(high[first], high[second]) - np.maximum(low[first], low[second]), np.minimum(extent[first], extent[second])
    shared = np.divide(into, smaller, out=np.minimum(np.sign(into), 0.0), where=smaller > 0)  # of what is flat: whether it reaches
    near = np.sort(shared, axis=1)
    touch = (np.abs(near[:, 0]) < TOUCH) & (near[:, 1:] > FACE).all(axis=1)
    held = _held(model)
    touch &= ~(held[first] & held[second])
    known = np.zeros((count, count), dtype=bool)
    for pair in detector.pairs:
        slaves, masters = np.unique(pair.slave.bodies), np.unique(pair.master.bodies)
        known[np.ix_(slaves, masters)] = known[np.ix_(masters, slaves)] = True
    touch &= ~known[first, second]
    for k in np.flatnonzero(touch)[:1]:
        more = f", and {int(touch.sum()) - 1} more such" if touch.sum() > 1 else ""
        names = model.bodies[int(first[k])].name, model.bodies[int(second[k])].name
        yield (
            f"bodies {names[0]!r} and {names[1]!r} touch, and no pair of surfaces names them both{more}: they pass through each other. "
            "Add a SurfacePair, or take Everything(model, ...) as the detector"
        )
