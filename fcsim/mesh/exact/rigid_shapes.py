"""Rigid bodies of exact shape: spheres (2D: disks), capsules, cylinders and planes; see `exact_shape`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcsim.arrays import FloatArray, is_number, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.exact_shape import ExactShape
from fcsim.mesh.part import RigidBody


def rigid_sphere(name: str, radius: float, centre: Sequence[float] | FloatArray, mass: float) -> RigidBody:
    """Return an exact homogeneous ball of `radius` [m] around `centre` (d,) [m], `mass` [kg]; in 2D a disk.

    Inertia 2/5 m r^2, of a disk m r^2 / 2.
    """
    centre = _point(name, "centre", centre)
    _positive(name, radius=radius)
    inertia = 0.4 * mass * radius**2 * np.eye(3) if len(centre) == 3 else np.array([[0.5 * mass * radius**2]])
    return _body(name, ExactShape("sphere", float(radius), 0.0, np.eye(len(centre))[-1]), centre, mass, inertia)


def rigid_capsule(
    name: str,
    radius: float,
    length: float,
    centre: Sequence[float] | FloatArray,
    mass: float,
    axis: Sequence[float] | FloatArray | None = None,
) -> RigidBody:
    """Return an exact homogeneous capsule: a cylinder of `length` [m] between two half balls of `radius` [m]; in 2D a stadium.

    axis: along the cylinder, by default the last one. Inertia of the cylinder and the half balls, each about its own centre of mass (of a
    half ball 3 r / 8, of a half disk 4 r / (3 pi) from its flat side), moved to the middle.
    """
    centre = _point(name, "centre", centre)
    _positive(name, radius=radius, length=length)
    direction, r = _direction(name, axis, len(centre)), radius
    if len(centre) == 2:
        disk = mass * np.pi * r / (np.pi * r + 2 * length)
        box, off = mass - disk, 4 * r / (3 * np.pi)
        inertia = np.array([[box * (length**2 + 4 * r**2) / 12 + disk * (r**2 / 2 - off**2 + (length / 2 + off) ** 2)]])
    else:
        balls = mass * 4 * r / (4 * r + 3 * length)
        rod = mass - balls
        along = rod * r**2 / 2 + 0.4 * balls * r**2
        across = rod * (3 * r**2 + length**2) / 12 + balls * (83 / 320 * r**2 + (length / 2 + 3 * r / 8) ** 2)
        inertia = _about(direction, along, across)
    return _body(name, ExactShape("capsule", float(radius), float(length), direction), centre, mass, inertia)


def rigid_cylinder(
    name: str,
    radius: float,
    length: float,
    centre: Sequence[float] | FloatArray,
    mass: float,
    axis: Sequence[float] | FloatArray | None = None,
) -> RigidBody:
    """Return an exact homogeneous cylinder of `radius` and `length` [m] with flat ends, in 3D; axis: by default z.

    Inertia m r^2 / 2 along the axis, m (3 r^2 + l^2) / 12 across.
    """
    centre = _point(name, "centre", centre)
    if len(centre) != 3:
        raise InputError(f"cylinder {name!r}: expected a centre in 3D, got {centre.tolist()}: in 2D it is a rigid_sphere (a disk)")
    _positive(name, radius=radius, length=length)
    direction = _direction(name, axis, 3)
    inertia = _about(direction, mass * radius**2 / 2, mass * (3 * radius**2 + length**2) / 12)
    return _body(name, ExactShape("cylinder", float(radius), float(length), direction), centre, mass, inertia)


def rigid_plane(
    name: str, point: Sequence[float] | FloatArray, normal: Sequence[float] | FloatArray, size: float = 1.0, mass: float = 1.0
) -> RigidBody:
    """Return the half-space below `point` (d,) [m], whose `normal` points out of it: an endless floor or wall, to be held by a support.

    size [m]: edge of the square that pictures show; mass and its inertia matter only where nothing holds it.
    """
    point = _point(name, "point", point)
    _positive(name, size=size)
    direction = _direction(name, normal, len(point))
    inertia = mass * size**2 * np.eye(3 if len(point) == 3 else 1)
    return _body(name, ExactShape("plane", size / 2, 0.0, direction), point, mass, inertia)


def _body(name: str, shape: ExactShape, centre: FloatArray, mass: float, inertia: FloatArray) -> RigidBody:
    points = np.concatenate([centre[None], centre + shape.radius * np.eye(len(centre))])
    return RigidBody(name, mass, inertia, centre, points, shape=shape)


def _about(axis: FloatArray, along: float, across: float) -> FloatArray:
    return across * np.eye(3) + (along - across) * np.outer(axis, axis)


def _point(name: str, argument: str, values: Sequence[float] | FloatArray) -> FloatArray:
    array = numbers_of(values)
    if array.shape not in ((2,), (3,)) or not np.all(np.isfinite(array)):
        raise InputError(f"{name!r}, {argument}: expected 2 or 3 finite numbers in m, got {shown(values)}")
    return array


def _direction(name: str, axis: Sequence[float] | FloatArray | None, d: int) -> FloatArray:
    direction = np.eye(d)[-1] if axis is None else numbers_of(axis)
    length = float(np.linalg.norm(direction)) if direction.shape == (d,) else 0.0
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"{name!r}: expected a direction of {d} numbers that is not zero, got {shown(axis)}")
    return direction / length


def _positive(name: str, **lengths: float) -> None:
    for argument, value in lengths.items():
        if not (is_number(value) and value > 0):
            raise InputError(f"{name!r}, {argument}: expected a length > 0 in m, got {shown(value)}")
