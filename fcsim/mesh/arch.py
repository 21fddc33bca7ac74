"""Semicircular arches of equal voussoirs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import IntArray, is_number
from fcsim.errors import InputError
from fcsim.mesh.blocks import AXES, brick, rectangle
from fcsim.mesh.material.law import AnyMaterial
from fcsim.mesh.part import Body


@dataclass(frozen=True, eq=False)
class SemicircularArch:
    """An arch of n equal voussoirs with radial joints over the origin, in the plane of x and z (2D: x and y), springing from height 0.

    bodies     "voussoir 1" ... "voussoir n" from the left springing to the right one, all of one part
    radius     [m] of the middle line; thickness [m]; depth [m] along y (2D: None)

    A voussoir has the surfaces "x-" and "x+", its joints to the left and to the right, and the lowest and highest of the axes,
    `intrados` and `extrados`. Its cells are straight: between the joints the surfaces are chords of the circles.
    """

    bodies: tuple[Body, ...]
    radius: float
    thickness: float
    depth: float | None

    @property
    def intrados(self) -> str:
        """Name of the surface towards the centre: "z-", in 2D "y-"."""
        return AXES[1 if self.depth is None else 2] + "-"

    @property
    def extrados(self) -> str:
        return AXES[1 if self.depth is None else 2] + "+"

    def joints(self) -> IntArray:
        """Pairs (left, right) (n - 1, 2) of body numbers: "x+" of the left faces "x-" of the right."""
        left = np.arange(len(self.bodies) - 1)
        return np.stack((left, left + 1), axis=1)


def semicircular_arch(
    voussoirs: int = 20,
    radius: float = 1.0,
    thickness: float = 0.12,
    depth: float | None = 0.3,
    divisions: Sequence[int] = (1, 1, 1),
    *,
    material: AnyMaterial,
    elements: str | None = None,
) -> SemicircularArch:
    """Return a semicircular arch of `voussoirs` equal blocks of hexahedra (depth=None: a plane one of quadrilaterals).

    radius      [m] of the middle line, thickness [m] < 2 radius, depth [m] along y
    divisions   elements of a voussoir along the arch, the depth and the thickness (2D: along the arch and the thickness)
    elements    those of `Part`
    """
    d = 2 if depth is None else 3
    if not is_number(voussoirs) or voussoirs < 2 or voussoirs != int(voussoirs):
        raise InputError(f"semicircular_arch, voussoirs: expected a whole number >= 2, got {voussoirs!r}")
    if not (is_number(radius) and is_number(thickness) and 0 < thickness < 2 * radius):
        raise InputError(f"semicircular_arch: expected a thickness > 0 and < 2 radius, got {thickness!r} and the radius {radius!r}")
    if len(divisions) != d:
        raise InputError(f"semicircular_arch, divisions: expected {d} whole numbers, got {divisions!r}")
    angle = np.pi / voussoirs
    if depth is None:
        straight = rectangle(
            "voussoir", (angle, thickness), divisions, material, origin=(-angle / 2, radius - thickness / 2), elements=elements
        )
    else:
        size, origin = (angle, depth, thickness), (-angle / 2, -depth / 2, radius - thickness / 2)
        straight = brick("voussoir", size, divisions, material, origin=origin, elements=elements)
    points = straight.points.copy()
    around, r = points[:, 0].copy(), points[:, -1].copy()
    points[:, 0], points[:, -1] = r * np.sin(around), r * np.cos(around)
    part = replace(straight, points=points)
    bodies = []
    for k in range(int(voussoirs)):
        a = (k + 0.5) * angle - np.pi / 2  # from the vertical, clockwise
        rotation = np.eye(d)
        rotation[0, 0] = rotation[-1, -1] = np.cos(a)
        rotation[0, -1], rotation[-1, 0] = np.sin(a), -np.sin(a)
        bodies.append(Body(f"voussoir {k + 1}", part, rotation))
    return SemicircularArch(tuple(bodies), float(radius), float(thickness), depth)
