"""Sensors ready made: what contacts and supports do to a body or a surface, how a point moves, how far a joint opens."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, IntArray, is_vector, numbers_of
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.locking import nodal_stress
from fcsim.assembly.model import Model
from fcsim.assembly.stress import COMPONENTS, von_mises
from fcsim.assembly.supports import Support
from fcsim.assembly.supports.selection import NodesNamed, Selection, SurfaceNames
from fcsim.brief import shown
from fcsim.errors import MODEL, InputError, expect
from fcsim.mesh.named.places import Where
from fcsim.mesh.part import RigidBody
from fcsim.running.case import Sensor
from fcsim.timestep.step import Step


def contact_force(column: str, model: Model, body: str, direction: str, surface: str | None = None, label: str = "") -> Sensor:
    """Resultant [N] in a direction, x, y or z, of the contact forces on a body, or on one of its surfaces alone.

    On a surface are the contacts all of whose nodes of the body are nodes of it; one at an edge is on both surfaces that share it.
    """
    expect(model, Model, "contact_force, model", MODEL)
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


def support_force(
    column: str,
    model: Model,
    body: str,
    direction: str,
    surface: SurfaceNames | None = None,
    label: str = "",
    axes: ArrayLike | None = None,
    *,
    at: ArrayLike | Where | None = None,
    nodes: NodesNamed | None = None,
) -> Sensor:
    """Resultant [N] of the supports' forces on a body, or on those of its nodes that surface, at and nodes name, along an axis of `axes`
    (all as those of `Support`). Where two supports share nodes, the forces of both.

    Of a rigid body also the moment [N m] about its centre, directions rx, ry, rz.
    """
    expect(model, Model, "support_force, model", MODEL)
    number, d = model.body_number(body), model.dimension
    first, chosen = model.dof_offset[number], Selection(surface, at, nodes)
    R = np.eye(d) if axes is None else np.array(Support(body, (direction,), axes=axes).axes)
    if R.shape != (d, d):
        raise InputError(f"support_force on body {body!r}, axes: expected a rotation matrix ({d}, {d}), got {R.shape}")
    if isinstance(model.bodies[number], RigidBody):
        names = DIRECTIONS[d]
        if not chosen.whole or direction not in names:
            raise InputError(f"support_force on rigid body {body!r}: expected no surface and a direction among {', '.join(names)}")
        turning = names.index(direction) >= d
        size = len(names) - d if turning else d
        dofs = (first + (d if turning else 0) + np.arange(size))[None]
        along = R[:, names.index(direction) % d] if size == d else np.ones(1)
    else:
        dofs, along = model.dof_of_node[_nodes(model, body, chosen, "support_force")], R[:, _axis(model, direction)]
    unit = "N m" if direction.startswith("r") else "N"
    text = label or f"force of the supports on {body}, {direction}"
    return Sensor(column, text, unit, lambda step: step.force_per_reaction * float(step.support_impulse[dofs].sum(axis=0) @ along))


def support_moment(
    column: str,
    model: Model,
    body: str,
    direction: str,
    point: Sequence[float],
    surface: SurfaceNames | None = None,
    label: str = "",
    *,
    at: ArrayLike | Where | None = None,
    nodes: NodesNamed | None = None,
) -> Sensor:
    """Moment [N m] about an axis (rx, ry or rz; 2D: rz) through a point (d,) [m] that stays where it is, of the supports' forces on a body,
    or on those of its nodes that surface, at and nodes name, as those of `Support` do: what drives a shaft or a drum. Forces act where the
    body stands in the middle of the step, in statics at its end."""
    expect(model, Model, "support_moment, model", MODEL)
    number, d = model.body_number(body), model.dimension
    names = DIRECTIONS[d][d:]
    if direction not in names:
        raise InputError(f"support_moment on body {body!r}: expected a direction among {', '.join(names)}, got {direction!r}")
    place, k = _point(model, point, f"support_moment on body {body!r}"), names.index(direction)
    given, first, chosen = model.bodies[number], model.dof_offset[number], Selection(surface, at, nodes)
    text = label or f"moment of the supports on {body}, {direction}"

    def about(arm: FloatArray, force: FloatArray) -> float:
        moments = arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0] if d == 2 else np.cross(arm, force)[:, k]
        return float(moments.sum())

    if isinstance(given, RigidBody):
        if not chosen.whole:
            raise InputError(f"support_moment on rigid body {body!r}: expected no surface, got {surface!r}")
        own = slice(first, first + d)
        begin = given.centre - place

        def of_rigid(step: Step) -> float:
            impulse = step.support_impulse
            arm = begin + _where(step, own)
            return step.force_per_reaction * (about(arm[None], impulse[own][None]) + float(impulse[first + d + k]))

        return Sensor(column, text, "N m", of_rigid)
    meant = _nodes(model, body, chosen, "support_moment")
    dofs, start = model.dof_of_node[meant], model.reference[meant] - place

    def of_nodes(step: Step) -> float:
        arm = start + _where(step, dofs)
        return step.force_per_reaction * about(arm, step.support_impulse[dofs])

    return Sensor(column, text, "N m", of_nodes)


def _where(step: Step, dofs: IntArray | slice) -> FloatArray:
    """Displacements of dofs where a step's forces act."""
    if not step.scheme.timing.moving:
        return step.state.x[dofs]
    middle: FloatArray = 0.5 * (step.previous.x[dofs] + step.state.x[dofs])
    return middle


def displacement(column: str, model: Model, body: str, direction: str, point: Sequence[float], label: str = "") -> Sensor:
    """Displacement [m] of a body's node at a point (d,) [m] of the reference configuration, or of the material point of a rigid body."""
    expect(model, Model, "displacement, model", MODEL)
    number, axis = model.body_number(body), _axis(model, direction)
    place = _point(model, point, f"displacement of body {body!r}")
    given = model.bodies[number]
    text = label or f"displacement of {body} at {tuple(float(c) for c in place)}, {direction}"
    if isinstance(given, RigidBody):
        rigid = number - len(model.deformable)
        first, arm, d = model.dof_offset[number], place - given.centre, model.dimension

        def measure(step: Step) -> float:
            x = step.state.x
            return float((x[first : first + d] + model.rigid_rotation(x)[rigid] @ arm - arm)[axis])

        return Sensor(column, text, "m", measure)
    with np.errstate(over="ignore"):  # what is beyond all floats is at no node
        away = np.linalg.norm(given.points - place, axis=1)
    node = int(np.argmin(away))
    if away[node] > 1e-6 * np.ptp(given.points, axis=0).max():
        nearest = tuple(float(c) for c in given.points[node])
        raise InputError(
            f"displacement of body {body!r}: expected a point at a node, got {tuple(place.tolist())}; the nearest is at {nearest}"
        )
    dof = model.dof_of_node[model.node_offset[number] + node, axis]
    return Sensor(column, text, "m", lambda step: float(step.state.x[dof]))


def stress(column: str, model: Model, body: str, component: str, point: Sequence[float], label: str = "") -> Sensor:
    """Stress [Pa] of a deformable body at its node at a point (d,) [m] of the reference: a component xx, yy, zz, xy, yz, zx along the
    world's axes, or "von_mises", recovered from the cells around the node (`nodal_stress`)."""
    expect(model, Model, "stress, model", MODEL)
    what = f"stress of body {body!r}"
    number = model.body_number(body)
    if component not in (*COMPONENTS, "von_mises"):
        raise InputError(f"{what}: expected a component among {', '.join(COMPONENTS)}, von_mises, got {component!r}")
    (node,) = Selection(at=_point(model, point, what)).of(model, body, what)

    def measure(step: Step) -> float:
        at = nodal_stress(model, number, step.state.x, step.state.internal, step.state.t)[node]
        return float(von_mises(at) if component == "von_mises" else at[COMPONENTS.index(component)])

    return Sensor(column, label or f"stress of {body} at {tuple(float(c) for c in point)}, {component}", "Pa", measure)


def joint_opening(column: str, model: Model, first: tuple[str, str], second: tuple[str, str], label: str = "") -> Sensor:
    """Largest opening [m] of the joint between two surfaces (body, surface), 0 in the reference configuration.

    Measured between nodes of the two surfaces that are each the other's nearest, along the first surface's mean normal, all in the
    reference configuration; negative where the joint is pressed together everywhere.
    """
    for pair in (first, second):
        if not (isinstance(pair, tuple | list) and len(pair) == 2):
            raise InputError(f"joint_opening: expected the names of a body and of its surface, got {shown(pair)}")
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


def _nodes(model: Model, body: str, selection: Selection, what: str) -> IntArray:
    """Numbers of the nodes that are meant of a body."""
    return model.node_offset[model.body_number(body)] + selection.of(model, body, f"{what} on body {body!r}")


def _point(model: Model, point: Sequence[float], what: str) -> FloatArray:
    if not is_vector(point, model.dimension):
        raise InputError(f"{what}: expected a point of {model.dimension} finite coordinates, got {shown(point)}")
    return numbers_of(point)


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
