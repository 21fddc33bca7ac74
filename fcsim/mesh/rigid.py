"""Rigid bodies from meshes: mass, centre of mass and inertia integrated over the cells, surfaces kept."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal, NamedTuple, get_args
from weakref import WeakKeyDictionary

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError, expect
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.order.linear_facets import linear_facets
from fcsim.mesh.order.quadrature import quadrature
from fcsim.mesh.part import Body, Part, RigidBody

BlockKind = Literal["deformable", "rigid", "mixed"]


class MassProperties(NamedTuple):
    """mass [kg]; centre (d,) [m]; inertia about it (3, 3), in 2D (1, 1) [kg m^2], in the part's axes."""

    mass: float
    centre: FloatArray
    inertia: FloatArray


_KNOWN: WeakKeyDictionary[Part, MassProperties] = WeakKeyDictionary()


def mass_properties(part: Part) -> MassProperties:
    """Return mass, centre of mass and inertia of a part's mesh with its material's density, exact for its (bilinear) cells.

    m = int rho, c = int rho x / m, S = int rho (x - c)(x - c)^T, inertia tr(S) I - S, in 2D tr(S); 2D integrals times the thickness.
    Computed once for each part. InputError for a part without density.
    """
    expect(part, Part, "mass_properties, part", "a Part, as brick(...) gives")
    if part not in _KNOWN:
        _KNOWN[part] = _integrated(part)
    return _KNOWN[part]


def rigid_body(body: Body) -> RigidBody:
    """Return a placed part as a rigid body: its name, its mass, centre and inertia (see `mass_properties`), its surfaces.

    Of the nodes it keeps those of the surfaces; facets of second order become linear ones (`fcsim.mesh.order`). InputError for a part
    without density or without surfaces.
    """
    if not isinstance(body, Body):
        mend = f"; a Part is placed by Body({body.name!r}, part)" if isinstance(body, Part) else ""
        raise InputError(f"rigid_body: expected a Body of a meshed part, got {type(body).__name__}{mend}")
    part = body.part
    if not part.surfaces:
        raise InputError(f"rigid body of {body.name!r}: expected a part with surfaces, got {part.name!r} that has none")
    mass, centre, inertia = mass_properties(part)
    R = body.rotation
    linear = {name: linear_facets(facets, CELL_TYPES[part.cell_type]) for name, facets in part.surfaces.items()}
    used, numbers = np.unique(np.concatenate([facets.ravel() for facets in linear.values()]), return_inverse=True)
    ends = np.cumsum([facets.size for facets in linear.values()])[:-1]
    pieces = np.split(numbers.ravel(), ends)
    surfaces = {name: piece.reshape(facets.shape) for (name, facets), piece in zip(linear.items(), pieces, strict=True)}
    turned = R @ inertia @ R.T if part.dimension == 3 else inertia
    return RigidBody(body.name, mass, 0.5 * (turned + turned.T), R @ centre + body.translation, body.points[used], surfaces)


def blocks_that_are(kind: BlockKind, bodies: Sequence[Body]) -> list[Body | RigidBody]:
    """Return the bodies as they are ("deformable"), all as rigid bodies ("rigid"), or every second one, from the second on ("mixed").

    Joints of rigid blocks have more contact points than motions, so that W is singular and reactions are not unique: the solver
    PPA-NSN-AC bears that best, ADMM and auto bear it, Newton's method alone does not.
    """
    if kind not in get_args(BlockKind):
        raise InputError(f"kind of blocks: expected one of {', '.join(get_args(BlockKind))}, got {kind!r}")
    if kind == "deformable":
        return list(bodies)
    return [rigid_body(body) if kind == "rigid" or place % 2 else body for place, body in enumerate(bodies)]


def _integrated(part: Part) -> MassProperties:
    if isinstance(part.material, ByRegion):
        raise InputError(f"mass of part {part.name!r}: expected one material for a rigid body, got several by region")
    d, density = part.dimension, part.material.density
    if not density > 0:
        raise InputError(f"mass of part {part.name!r}: expected a material with a density > 0 kg/m^3, got {density}")
    shape, gradient, weight = _quadrature(part.cell_type)
    origin = part.points.mean(axis=0)  # near the centre, so that the moments lose no digits
    corners = (part.points - origin)[part.cells]
    x = np.einsum("qk,ckd->cqd", shape, corners)
    volume = weight * np.linalg.det(np.einsum("qkr,ckd->cqdr", gradient, corners)) * part.thickness ** (3 - d)
    mass = density * float(volume.sum())
    centre = density / mass * np.einsum("cq,cqd->d", volume, x)
    arm = x - centre
    S = density * np.einsum("cq,cqi,cqj->ij", volume, arm, arm)
    trace = np.trace(S)
    return MassProperties(mass, origin + centre, trace * np.eye(3) - S if d == 3 else np.array([[trace]]))


def _quadrature(cell_type: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Shape functions (nq, k), their gradients (nq, k, d) and weights (nq,) on the reference cell: exact for x x^T times the Jacobian.

    Simplices: the symmetric rules of degree 2; others: 3 Gauss points a direction, of degree 5 (the product has 4 in each direction);
    cells of second order: 5 Gauss points a direction.
    """
    cell = CELL_TYPES[cell_type]
    d = cell.dimension
    if cell.order == 2:  # x x^T J has the degree 4 + d in each direction, on simplices 4 + 3 (d - 1) in all at most
        point, weight = quadrature(cell, 5)
    elif cell.simplex:
        near = {2: 2 / 3, 3: (5 + 3 * np.sqrt(5)) / 20}[d]
        point = np.full((d + 1, d), (1 - near) / d)
        point[1:] += (near - (1 - near) / d) * np.eye(d)
        weight = np.full(d + 1, 1 / (2 * (d + 1) if d == 2 else 6 * (d + 1)))
    else:
        nodes, weights = np.polynomial.legendre.leggauss(3)
        point = np.array(list(product(nodes, repeat=d)))
        weight = np.array(list(product(weights, repeat=d))).prod(axis=1)
    return cell.shape(point), cell.gradient(point), weight
