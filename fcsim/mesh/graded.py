"""Meshes graded towards a point of contact: half balls and half disks, and the bricks and rectangles that they press on.

All four touch the plane z = 0 (in 2D y = 0) at the origin. A core, a cube (square) of `core` half-width with `divisions` equal elements
a half-width, is wrapped in layers of elements that grow with the distance from the origin and keep their shape. A half ball is the
image of the half of a unit ball of such layers under an inversion (stereographic projection on its surface), which keeps angles, hence
the shape of the elements. Of every body the model may hold a half or quarter, cut by planes of symmetry through the origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray, is_number
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.blocks import AXES, brick, rectangle
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.law import AnyMaterial
from fcsim.mesh.material.linear import Material
from fcsim.mesh.part import Part
from fcsim.mesh.quality import check_quality

Side = Literal["above", "below"]

_REACHED = 1e-9  # relative: coordinates of the layers are products of a few roundings


def half_ball(
    name: str,
    radius: float,
    core: float,
    divisions: int,
    material: AnyMaterial,
    *,
    whole: str = "",
    side: Side = "above",
    layers: int | None = None,
) -> Part:
    """Return the half of a ball of `radius` [m] that touches the plane z = 0 at the origin, from `side`; hexahedra.

    core       [m] half-width of the finely meshed square around the origin, `divisions` elements along it
    whole      axes along which the body is not cut: "" leaves the quarter x >= 0, y >= 0, "x" the half y >= 0, "xy" everything
    layers     number of layers around the core; default: as many as keep the elements' shape

    Surfaces: "contact", the core's part of the curved surface; "curved", all of it; "middle", the plane through the ball's centre;
    "x-", "y-", the planes of symmetry.
    """
    return _half_round(_Layered(name, radius, core, divisions, 3, whole, side, layers), material)


def half_disk(
    name: str,
    radius: float,
    core: float,
    divisions: int,
    material: AnyMaterial,
    *,
    whole: str = "",
    side: Side = "above",
    layers: int | None = None,
) -> Part:
    """Return the half of a disk that touches the line y = 0 at the origin: a cylinder in plane strain; quadrilaterals.

    Arguments and surfaces as in `half_ball`; `whole` is "" (x >= 0) or "x".
    """
    return _half_round(_Layered(name, radius, core, divisions, 2, whole, side, layers), material)


def graded_brick(
    name: str,
    size: float,
    core: float,
    divisions: int,
    material: AnyMaterial,
    *,
    whole: str = "",
    side: Side = "below",
    layers: int | None = None,
) -> Part:
    """Return a brick under the plane z = 0 (or above it) that reaches `size` [m] from the origin in every direction; hexahedra.

    `core`, `divisions`, `whole`, `layers` as in `half_ball`. Surfaces: "contact", the core's face in z = 0; "face", all of that face;
    "base", the face opposite; "rim", the outer faces in between; "x-", "y-", the planes of symmetry.
    """
    return _half_space(_Layered(name, size, core, divisions, 3, whole, side, layers), material)


def graded_rectangle(
    name: str,
    size: float,
    core: float,
    divisions: int,
    material: AnyMaterial,
    *,
    whole: str = "",
    side: Side = "below",
    layers: int | None = None,
) -> Part:
    """Return a rectangle under the line y = 0 (or above it), as `graded_brick` does a brick; quadrilaterals in plane strain."""
    return _half_space(_Layered(name, size, core, divisions, 2, whole, side, layers), material)


@dataclass(frozen=True)
class _Layered:
    """What was asked for: a body of `radius` or reach `size` [m] in d dimensions, the rest as in `half_ball`."""

    name: str
    size: float
    core: float
    divisions: int
    d: int
    whole: str
    side: Side
    layers: int | None

    def check(self, size: str) -> None:
        """InputError for what no such body has; size: what the caller calls it."""
        if not (is_number(self.core) and is_number(self.size) and 0 < self.core < self.size):
            got = f"core {shown(self.core)} and {size} {shown(self.size)}"
            raise InputError(f"{self.name!r}: expected 0 < core < {size} in m, got {got}")
        if self.side not in ("above", "below"):
            raise InputError(f"{self.name!r}, side: expected 'above' or 'below', got {self.side!r}")
        if not set(self.whole) <= set(self.across):
            raise InputError(f"{self.name!r}, whole: expected axes among {self.across!r}, got {self.whole!r}")
        for what, given in (("divisions", self.divisions), ("layers", self.layers)):
            if given is not None and (given < 1 or given != int(given)):
                raise InputError(f"{self.name!r}, {what}: expected a whole number >= 1, got {given!r}")

    @property
    def across(self) -> str:
        """The axes in the plane that the body touches."""
        return AXES[: self.d - 1]


def _half_round(asked: _Layered, material: AnyMaterial) -> Part:
    asked.check("radius")
    radius = asked.size
    width = np.tan(np.arcsin(asked.core / radius) / 2)  # the core's half-width in the unit ball
    grid = _grid(asked, 1 / width)
    cubical, distance = grid.points, np.abs(grid.points).max(axis=1)
    outside = np.maximum(distance, 1.0)
    length = np.linalg.norm(cubical, axis=1)
    # from the cube of the core to the unit ball: shells of the maximum norm become round outwards
    roundness = np.log(outside) / np.log(1 / width)
    factor = (1 - roundness) + roundness * np.divide(distance, length, out=np.ones_like(length), where=length > 0)
    unit = width * cubical * factor[:, None]
    # inversion about the antipode, mirrored: plane to sphere, unit hemisphere to the plane through the centre
    up = np.abs(unit[:, -1])
    aside = np.einsum("nd,nd->n", unit[:, :-1], unit[:, :-1])
    quotient = 1 / (aside + (1 + up) ** 2)
    points = np.empty_like(unit)
    points[:, :-1] = 2 * radius * quotient[:, None] * unit[:, :-1]
    height = 2 * radius * quotient * (aside + up * (1 + up))  # = 2 R - 2 R (1 + up) quotient, without its cancellation
    points[:, -1] = height if asked.side == "above" else -height
    outer = distance >= (1 - _REACHED) / width
    return grid.part(asked.name, points, material, {"curved": grid.plane, "middle": outer})


def _half_space(asked: _Layered, material: AnyMaterial) -> Part:
    asked.check("size")
    reach = asked.size / asked.core
    grid = _grid(asked, reach)
    base = np.abs(grid.points[:, -1]) >= reach * (1 - _REACHED)
    rim = np.abs(grid.points[:, :-1]).max(axis=1) >= reach * (1 - _REACHED)
    return grid.part(asked.name, asked.core * grid.points, material, {"face": grid.plane, "base": base, "rim": rim})


@dataclass(frozen=True, eq=False)
class _Grid:
    """A core of half-width 1 and its layers: points (n, d), cells, how many of them are the core's; plane: points in z = 0."""

    points: FloatArray
    cells: IntArray
    cell_type: str
    core_cells: int
    symmetric: str

    @property
    def plane(self) -> BoolArray:
        return np.abs(self.points[:, -1]) < _REACHED

    def part(self, name: str, points: FloatArray, material: AnyMaterial, sides: dict[str, BoolArray]) -> Part:
        """The part of the moved points, its boundary facets sorted by the masks (n,) of `sides` and the planes of symmetry."""
        facets, of_core = self._boundary()
        masks = {**sides, **{f"{axis}-": np.abs(self.points[:, AXES.index(axis)]) < _REACHED for axis in self.symmetric}}
        surfaces = {"contact": facets[of_core & self.plane[facets].all(axis=1)]}
        surfaces |= {label: facets[mask[facets].all(axis=1)] for label, mask in masks.items()}
        part = Part(name, points, self.cells, self.cell_type, surfaces, material)
        check_quality(part)
        return part

    def _boundary(self) -> tuple[IntArray, BoolArray]:
        """Outward facets that belong to one cell, and whether it is one of the core."""
        local = CELL_TYPES[self.cell_type].facets
        facets = self.cells[:, local].reshape(-1, local.shape[1])
        _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
        single = np.sort(first[count == 1])
        return facets[single], single < self.core_cells * len(local)


def _grid(asked: _Layered, reach: float) -> _Grid:
    """The core [-1 or 0, 1]^(d-1) x [0, 1] (below: [-1, 0]) and layers of the maximum norm from 1 to `reach`."""
    name, d, across, whole, side, divisions = asked.name, asked.d, asked.across, asked.whole, asked.side, asked.divisions
    layers = asked.layers or max(1, round(divisions * np.log(reach)))  # then as long as they are wide
    lower = np.array([-1.0 if axis in whole else 0.0 for axis in across] + [0.0 if side == "above" else -1.0])
    upper = np.array([1.0] * (d - 1) + [1.0 if side == "above" else 0.0])
    counts = np.round(divisions * (upper - lower)).astype(int)
    box = brick if d == 3 else rectangle
    core = box(name, upper - lower, counts.tolist(), Material(E=1.0, nu=0.0, density=0.0), origin=lower.tolist())
    depth = AXES[d - 1] + ("+" if side == "above" else "-")
    wrapped = [f"{axis}+" for axis in across] + [f"{axis}-" for axis in whole] + [depth]
    facets = np.concatenate([core.surfaces[label] for label in wrapped])

    nodes, facets = np.unique(facets, return_inverse=True)
    facets = facets.reshape(-1, CELL_TYPES[core.cell_type].facet_size)
    inner, scale = core.points[nodes], reach ** (np.arange(1, layers + 1) / layers)
    points = np.concatenate([core.points, (scale[:, None, None] * inner).reshape(-1, d)])
    # numbers of the layers' nodes (layers + 1, n); the first are the core's
    number = np.concatenate([nodes[None], len(core.points) + np.arange(layers * len(nodes)).reshape(layers, -1)])
    below, above = number[:-1][:, facets], number[1:][:, facets]
    shells = [below, above] if d == 3 else [below[..., ::-1], above]
    cells = np.concatenate([core.cells, np.concatenate(shells, axis=-1).reshape(-1, core.cells.shape[1])])
    return _Grid(points, cells, core.cell_type, len(core.cells), "".join(axis for axis in across if axis not in whole))
