"""Loads: tractions and volume forces on deformable bodies, forces and moments on rigid ones, times functions of the time;
and the areas by which a contact force is a pressure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import FloatArray, IntArray, is_number, is_vector, numbers_of
from fcsim.assembly import elasticity
from fcsim.assembly.forms.facet_pressure import facet_forces, nodal_sum
from fcsim.assembly.forms.nodal_forces import form_forces, given_forces
from fcsim.assembly.forms.part_forms import PartForms
from fcsim.assembly.forms.turning_force import TurningForce
from fcsim.assembly.layout import DIRECTIONS, BodyLayout
from fcsim.assembly.supports import TimeFunction
from fcsim.assembly.supports.selection import NodesNamed, Selection, SurfaceNames, shares
from fcsim.brief import brief, shown
from fcsim.errors import MODEL, InputError, asked, expect
from fcsim.mesh.named.places import Where
from fcsim.mesh.part import Body, RigidBody

if TYPE_CHECKING:
    from dolfinx.fem import Function
    from ufl import Form


@dataclass(frozen=True)
class Traction:
    """A force per area [Pa] (2D: per length and thickness) on a deformable body's surface, in world axes, times factor(t)."""

    body: str
    surface: str
    traction: tuple[float, ...]
    factor: TimeFunction = field(default=lambda t: 1.0)


@dataclass(frozen=True)
class Force:
    """A force [N] at a rigid body's centre of mass, and a moment [N m] (3 entries, 2D: 1), in world axes, times factor(t).

    On a deformable body the force at nodes that `surface`, `at` and `nodes` name as those of a `Support` do, in all: at one point; over
    several equally; evenly over the length of a line (an edge), over the area of a surface. 2D: of the whole thickness. No moment there:
    `FollowerForce` has one.
    """

    body: str
    force: tuple[float, ...]
    moment: tuple[float, ...] | None = None
    factor: TimeFunction = field(default=lambda t: 1.0)
    surface: SurfaceNames | None = field(default=None, kw_only=True)
    at: ArrayLike | Where | None = field(default=None, kw_only=True)
    nodes: NodesNamed | None = field(default=None, kw_only=True)

    @property
    def selection(self) -> Selection:
        """Which nodes of a deformable body are meant."""
        return Selection(self.surface, self.at, self.nodes)


@dataclass(frozen=True)
class BodyForce:
    """A force per volume [N/m^3] on a deformable body, in world axes, times factor(t)."""

    body: str
    density: tuple[float, ...]
    factor: TimeFunction = field(default=lambda t: 1.0)


@dataclass(frozen=True)
class FollowerForce:
    """A force [N] and a moment [N m] (3 entries, 2D: 1) that turn with what they act on, in world axes as it stands in the reference, times
    factor(t).

    On a rigid body they act at its centre of mass, as those of `Force`. Of a deformable one a `surface` is named: they act at the middle of
    that surface, spread evenly over its area in the reference, and turn with it: by the rotation that leaves the least of its nodes'
    displacements (`fcsim.assembly.forms.turning_force`). A force on the end face of a beam keeps its angle with that face. On a body of
    linear kinematics, whose equations are those of the reference, they stay as they are.
    """

    body: str
    force: tuple[float, ...]
    moment: tuple[float, ...] | None = None
    factor: TimeFunction = field(default=lambda t: 1.0)
    surface: str | None = None


@dataclass(frozen=True)
class FollowerPressure:
    """A pressure [Pa] against the surface of a body, which it follows as the body turns and deforms, times factor(t).

    On a deformable body -p n acts on the faces as they stand; on one of linear kinematics, whose equations are those of the reference, as
    they stood there. 2D: on the part's thickness in the reference, of rigid bodies on 1 m.
    """

    body: str
    surface: str
    pressure: float
    factor: TimeFunction = field(default=lambda t: 1.0)


@dataclass(frozen=True, eq=False)
class NodalForces:
    """Forces (nn, d) [N] on the nodes of a deformable body, in the order of its part's points, in world axes, times factor(t).

    forces may be a dolfinx Function on the mesh that the part was made of, whose degrees of freedom they are.
    """

    body: str
    forces: FloatArray | Function
    factor: TimeFunction = field(default=lambda t: 1.0)

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class FormLoad:
    """Nodal forces of a linear form in UFL on a deformable body, times factor(t).

    form takes the part's `PartForms` and returns a form of its test function v, in the part's axes: lambda part: inner(f(part.x), part.v) *
    part.dx, or a traction with part.ds("surface"). Of a part that was made of a dolfinx mesh it may be a form itself, of a test function
    of ("Lagrange", order of the cells, (d,)) on that mesh. It turns with the placement of the body, not with its motion.
    """

    body: str
    form: Form | Callable[[PartForms], Form]
    factor: TimeFunction = field(default=lambda t: 1.0)


@dataclass(frozen=True)
class ForceAtPoint:
    """A force F [N] of fixed direction at a point p [m] of a rigid body, as it stands in the reference, which it moves with, and a moment
    [N m] (3 entries, 2D: 1) that stays, in world axes, times factor(t): about the centre of mass c of a body that has turned by R it is
    moment + R (p - c) x F.
    """

    body: str
    force: tuple[float, ...]
    point: tuple[float, ...]
    moment: tuple[float, ...] | None = None
    factor: TimeFunction = field(default=lambda t: 1.0)


Follower = FollowerForce | FollowerPressure | ForceAtPoint
Load = Traction | Force | BodyForce | NodalForces | FormLoad | Follower


def factor_at(load: Load, t: float) -> float:
    """The load's factor at time t [s]; InputError for what is no function of time, or no finite number."""
    what = f"{type(load).__name__} on body {load.body!r}, factor at t = {t} s: expected a function of t that gives a finite number, as"
    what += " lambda t: 2 * t"
    if not callable(load.factor):
        raise InputError(f"{what}, got {shown(load.factor)}")
    given = asked(what, load.factor, t)
    value = numbers_of(given)
    if value.size != 1 or not np.all(np.isfinite(value)):
        raise InputError(f"{what}, got {shown(given)}")
    return float(value.item())


def load_vector(layout: BodyLayout, load: Load) -> FloatArray:
    """Nodal forces (n_dofs,) [N] of a load at factor 1, in the reference configuration."""
    if not isinstance(load, Load):
        raise InputError(
            "loads: expected Traction, Force, BodyForce, NodalForces, FormLoad, FollowerForce or FollowerPressure, got an object of class "
            f"{type(load).__name__}; own loads are NodalForces or Force of any time function, a FormLoad of any form, or gravity(t)"
        )
    number = layout.body_number(load.body)
    body, d = layout.bodies[number], layout.dimension
    vector = np.zeros(layout.n_dofs)
    own = slice(layout.dof_offset[number], layout.dof_offset[number + 1])
    if isinstance(load, FollowerPressure):
        vector[own] = _pressure(layout, body, load)
        return vector
    if isinstance(load, ForceAtPoint):
        if not isinstance(body, RigidBody):
            raise InputError(f"ForceAtPoint on body {load.body!r}: expected a rigid body; Force(..., at=) acts on a deformable one")
        vector[own] = _about_centre(d, load, body, np.eye(d))
        return vector
    if isinstance(load, FollowerForce) and isinstance(body, Body):
        nodes, spread = turning_force(layout, load)
        vector[: layout.n_elastic].reshape(-1, d)[nodes] = spread.forces(layout.reference[nodes])
        return vector
    if isinstance(load, Force) and (isinstance(body, Body) or not load.selection.whole):
        vector[own] = _spread_force(layout, load).ravel()
        return vector
    if isinstance(load, Force | Follower):
        assert isinstance(body, RigidBody)
        if isinstance(load, FollowerForce) and load.surface is not None:
            raise InputError(f"FollowerForce on body {load.body!r}, surface: expected none on a rigid body, got {load.surface!r}")
        vector[own] = np.concatenate(_force_and_moment(d, load))
        return vector
    if not isinstance(body, Body):
        raise InputError(f"{type(load).__name__} on body {load.body!r}: expected a deformable body; use Force on a rigid one")
    if isinstance(load, NodalForces | FormLoad):
        vector[own] = _nodal_forces(body, load).ravel()
        return vector
    given = load.traction if isinstance(load, Traction) else load.density
    values = numbers_of(given)
    if values.shape != (d,) or not np.all(np.isfinite(values)):
        raise InputError(
            f"{type(load).__name__} on body {load.body!r}: expected {d} components, finite numbers, got {shown(given)}{_by_factor(given)}"
        )
    in_part_axes = body.rotation.T @ values
    if isinstance(load, Traction):
        nodal = elasticity.traction(body.part, load.surface, in_part_axes)
    else:
        nodal = elasticity.body_force(body.part, in_part_axes)
    vector[own] = (nodal.reshape(-1, d) @ body.rotation.T).ravel()
    return vector


def _spread_force(layout: BodyLayout, load: Force) -> FloatArray:
    """Nodal forces (nn, d) [N] of a force on a deformable body."""
    what = f"Force on body {load.body!r}"
    body = layout.bodies[layout.body_number(load.body)]
    if isinstance(body, Body) and load.selection.whole:
        raise InputError(
            f"{what}: expected the place where it acts on a deformable body: at=(x, y, z) of a node, surface= or nodes=; tractions are "
            "Traction, forces per volume BodyForce"
        )
    nodes = load.selection.of(layout, load.body, what)
    force = _force_and_moment(layout.dimension, load)[0]
    if load.moment is not None:
        raise InputError(f"{what}: expected no moment on a deformable body, got {load.moment}; a FollowerForce on a surface has one")
    assert isinstance(body, Body)
    nodal = np.zeros((len(body.part.points), layout.dimension))
    nodal[nodes] = shares(body, nodes, what)[:, None] * force
    return nodal


def _about_centre(d: int, load: ForceAtPoint, body: RigidBody, rotation: FloatArray) -> FloatArray:
    """Force and moment about the centre of mass of a body that has turned by `rotation` (d, d)."""
    force, moment = _force_and_moment(d, load)
    if not is_vector(load.point, d):
        raise InputError(f"ForceAtPoint on body {load.body!r}, point: expected {d} finite numbers, got {shown(load.point)}")
    arm = rotation @ (np.array(load.point, dtype=np.float64) - body.centre)
    turning = np.cross(arm, force) if d == 3 else np.array([arm[0] * force[1] - arm[1] * force[0]])
    return np.concatenate([force, moment + turning])


def _force_and_moment(d: int, load: Force | FollowerForce | ForceAtPoint) -> tuple[FloatArray, FloatArray]:
    """(d,) [N] and (3,), in 2D (1,), [N m]."""
    count = len(DIRECTIONS[d]) - d
    moment = (0.0,) * count if load.moment is None else load.moment
    values = np.concatenate([force := numbers_of(load.force).ravel(), turn := numbers_of(moment).ravel()])
    if len(force) != d or len(turn) != count or np.ndim(load.force) != 1 or not np.all(np.isfinite(values)):
        raise InputError(
            f"{type(load).__name__} on body {load.body!r}: expected {d} force and {count} moment components, finite numbers, got "
            f"{shown(load.force)} and {shown(load.moment)}{_by_factor(load.force, load.moment)}"
        )
    return values[:d], values[d:]


def _by_factor(*given: object) -> str:
    return ": how a load changes in time is its factor, a function of the time" if any(map(callable, given)) else ""


def turning_force(layout: BodyLayout, load: FollowerForce) -> tuple[IntArray, TurningForce]:
    """The nodes (k,), by the model's numbers, of a follower's surface of a deformable body, and its force on them."""
    if load.surface is None:
        raise InputError(
            f"FollowerForce on body {load.body!r}, surface: expected the name of a surface of this deformable body, on which it acts and "
            "with which it turns, got None"
        )
    layout.facets(load.body, load.surface)  # refuses an unknown name
    area = nodal_area(layout, load.body, load.surface)
    nodes = np.flatnonzero(area)
    return nodes, TurningForce(area[nodes] / area.sum(), layout.reference[nodes], *_force_and_moment(layout.dimension, load))


def _nodal_forces(body: Body, load: NodalForces | FormLoad) -> FloatArray:
    """Forces (nn, d) [N] in world axes."""
    what = f"{type(load).__name__} on body {load.body!r}"
    if isinstance(load, FormLoad):
        return form_forces(body.part, load.form, what) @ body.rotation.T
    return given_forces(body.part, load.forces, what)


def _pressure(layout: BodyLayout, body: Body | RigidBody, load: FollowerPressure) -> FloatArray:
    """Of a unit factor the nodal forces on a deformable body (nn d,); of a rigid one force and moment about the centre of mass, -p times
    the integrals of n and (x - c) x n, exact on flat facets."""
    if not is_number(load.pressure):
        raise InputError(f"FollowerPressure on body {load.body!r}: expected a finite pressure in Pa, got {shown(load.pressure)}")
    layout.facets(load.body, load.surface)  # refuses an unknown name
    if isinstance(body, Body):
        facets, points = body.part.surfaces[load.surface], body.points
        forces: FloatArray = nodal_sum(facet_forces(points[facets]), facets, len(points)).ravel()
        return -load.pressure * body.part.thickness * forces
    corners = body.points[body.surfaces[load.surface]] - body.centre
    if body.dimension == 2:
        along = corners[:, 1] - corners[:, 0]
        normal, middle = np.stack([along[:, 1], -along[:, 0]], axis=1), corners.mean(axis=1)
        turning = middle[:, 0] * normal[:, 1] - middle[:, 1] * normal[:, 0]
        return -load.pressure * np.array([*normal.sum(axis=0), turning.sum()])
    triangles = corners[:, :3] if corners.shape[1] == 3 else np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    normal = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    moment = np.cross(triangles.mean(axis=1), normal).sum(axis=0)
    return -load.pressure * np.concatenate([normal.sum(axis=0), moment])


def turned(layout: BodyLayout, load: Follower, vector: FloatArray, rotations: FloatArray) -> FloatArray:
    """The force and moment of `vector` (n_dofs,) turned with the body of a follower; rotations (nr, d, d) of the rigid bodies. Of a force
    at a point its arm turns alone."""
    d, number = layout.dimension, layout.body_number(load.body)
    rotation = rotations[number - len(layout.deformable)]
    own = slice(layout.dof_offset[number], layout.dof_offset[number + 1])
    values, result = vector[own], np.zeros_like(vector)
    if isinstance(load, ForceAtPoint):
        result[own] = _about_centre(d, load, layout.rigid[number - len(layout.deformable)], rotation)
        return result
    result[own] = np.concatenate([rotation @ values[:d], rotation @ values[d:] if d == 3 else values[d:]])
    return result


def nodal_area(layout: BodyLayout, body: str, surface: str) -> FloatArray:
    """Return A_a = integral of N_a over a deformable body's surface (n_nodes,) [m^2], by the model's node numbers, zero elsewhere.

    N_a is the shape function of node a on the reference configuration (in 2D times the thickness). A contact force divided by it is
    the nodal pressure, or traction, on that surface.
    """
    expect(layout, BodyLayout, "nodal_area, layout", MODEL)
    owner = layout.bodies[layout.body_number(body)]
    if not isinstance(owner, Body):
        raise InputError(f"nodal_area: expected a deformable body, got the rigid body {body!r}")
    area = np.zeros(layout.n_nodes)
    first = layout.node_offset[layout.number[body]]
    along = np.eye(layout.dimension)[0]
    area[first : first + len(owner.part.points)] = elasticity.traction(owner.part, surface, along)[:: layout.dimension]
    return area


def weight(of_units: FloatArray, g: FloatArray) -> FloatArray:
    """M g (n_dofs,) [N] of gravity g (d,) [m/s^2] from M e, of_units (d, n_dofs) [kg], of the accelerations 1 along each axis; g is along
    one of these mostly."""
    along = np.flatnonzero(g)
    force: FloatArray = g[along[0]] * of_units[along[0]] if len(along) == 1 else g @ of_units
    return force
