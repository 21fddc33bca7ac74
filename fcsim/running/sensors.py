"""Sensors ready made: what contacts and supports do to a body or a surface, how a point moves, how far a joint opens."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model
from fcsim.errors import InputError
from fcsim.mesh.part import RigidBody
from fcsim.running.case import Sensor
from fcsim.timestep.step import Step


def contact_force(column: str, model: Model, body: str, direction: str, surface: str | None = None, label: str = "") -> Sensor:
    """Resultant [N] in a direction, x, y or z, of the contact forces on a body, or on one of its surfaces alone.

    On a surface are the contacts all of whose nodes of the body are nodes of it; one at an edge is on both surfaces that share it.
    """
    number, axis = model.body_number(body), _axis(model, direction)
    nodes = np.zeros(model.n_nodes, dtype=bool)
    if surface is None:
        nodes[model.node_offset[number] : model.node_offset[number + 1]] = True
    else:
        nodes[model.facets(body, surface).ravel()] = True
    own = np.zeros(model.n_nodes, dtype=bool)
    own[model.node_offset[number] : model.node_offset[number + 1]] = True

    def measure(step: Step) -> float:
        contacts = step.contacts
        elsewhere = np.any(own[contacts.nodes] & ~nodes[contacts.nodes] & (contacts.nodes >= 0) & (contacts.weights != 0), axis=1)
        sign = (contacts.bodies[:, 0] == number) * 1.0 - (contacts.bodies[:, 1] == number) * 1.0
        return float((sign * ~elsewhere) @ step.force_in_space[:, axis])

    return Sensor(column, label or f"contact force on {surface or ''} {body}, {direction}".replace("  ", " "), "N", measure)


def support_force(column: str, model: Model, body: str, direction: str, surface: str | None = None, label: str = "") -> Sensor:
    """Resultant [N] of the supports' forces on a body, or on the nodes of one of its surfaces.

    Of a rigid body also the moment [N m] about its centre, directions rx, ry, rz.
    """
    number = model.body_number(body)
    first = model.dof_offset[number]
    if isinstance(model.bodies[number], RigidBody):
        names = DIRECTIONS[model.dimension]
        if surface is not None or direction not in names:
            raise InputError(f"support_force on rigid body {body!r}: expected no surface and a direction among {', '.join(names)}")
        dofs = np.array([first + names.index(direction)])
    else:
        nodes = np.arange(model.node_offset[number], model.node_offset[number + 1])
        if surface is not None:
            nodes = np.unique(model.facets(body, surface))
        dofs = model.dof_of_node[nodes, _axis(model, direction)]
    unit = "N m" if direction.startswith("r") else "N"
    text = label or f"force of the supports on {body}, {direction}"
    return Sensor(column, text, unit, lambda step: step.force_per_reaction * float(step.support_impulse[dofs].sum()))


def displacement(column: str, model: Model, body: str, direction: str, point: Sequence[float], label: str = "") -> Sensor:
    """Displacement [m] of a body's node at a point (d,) [m] of the reference configuration, or of the material point of a rigid body."""
    number, axis = model.body_number(body), _axis(model, direction)
    place = np.asarray(point, dtype=np.float64)
    if place.shape != (model.dimension,) or not np.all(np.isfinite(place)):
        raise InputError(f"displacement of body {body!r}: expected a point of {model.dimension} finite coordinates, got {point!r}")
    given = model.bodies[number]
    text = label or f"displacement of {body} at {tuple(float(c) for c in place)}, {direction}"
    if isinstance(given, RigidBody):
        rigid = number - len(model.deformable)
        first, arm, d = model.dof_offset[number], place - given.centre, model.dimension

        def measure(step: Step) -> float:
            x = step.state.x
            return float((x[first : first + d] + model.rigid_rotation(x)[rigid] @ arm - arm)[axis])

        return Sensor(column, text, "m", measure)
    distance, node = cKDTree(given.points).query(place)
    if distance > 1e-6 * np.ptp(given.points, axis=0).max():
        nearest = tuple(float(c) for c in given.points[node])
        raise InputError(
            f"displacement of body {body!r}: expected a point at a node, got {tuple(place.tolist())}; the nearest is at {nearest}"
        )
    dof = model.dof_of_node[model.node_offset[number] + node, axis]
    return Sensor(column, text, "m", lambda step: float(step.state.x[dof]))


def joint_opening(column: str, model: Model, first: tuple[str, str], second: tuple[str, str], label: str = "") -> Sensor:
    """Largest opening [m] of the joint between two surfaces (body, surface), 0 in the reference configuration.

    Measured between nodes of the two surfaces that are each the other's nearest, along the first surface's mean normal, all in the
    reference configuration; negative where the joint is pressed together everywhere.
    """
    facets = model.facets(*first)
    here, there = np.unique(facets), np.unique(model.facets(*second))
    x = model.reference
    normal = _mean_normal(x[facets])
    nearest, back = cKDTree(x[there]).query(x[here])[1], cKDTree(x[here]).query(x[there])[1]
    opposite = back[nearest] == np.arange(len(here))
    here, there = here[opposite], there[nearest[opposite]]
    text = label or f"opening between {first[0]} and {second[0]}"

    def measure(step: Step) -> float:
        u = model.node_displacement(step.state.x)
        return float(((u[there] - u[here]) @ normal).max())

    return Sensor(column, text, "m", measure)


def _axis(model: Model, direction: str) -> int:
    names = DIRECTIONS[model.dimension][: model.dimension]
    if direction not in names:
        raise InputError(f"direction: expected one of {', '.join(names)}, got {direction!r}")
    return names.index(direction)


def _mean_normal(corners: FloatArray) -> FloatArray:
    """Unit mean outward normal (d,) of facets (nf, k, d)."""
    if corners.shape[2] == 2:
        along = (corners[:, 1] - corners[:, 0]).sum(axis=0)
        normal = np.array([along[1], -along[0]])
    else:
        diagonal = (corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
        if corners.shape[1] == 3:
            diagonal = (corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal = np.cross(*diagonal).sum(axis=0)
    return normal / np.linalg.norm(normal)
