"""Elements that lock, named as a run begins: in nearly incompressible materials, in plastic flow, in slender parts that bend.

A cell of first order that bends with the curvature k along its length l shears by k x instead of bending: the energy G k^2 l^2 / 12 beside
E k^2 H^2 / 12 of the section of height H, so that the part is too stiff by about G / E (l / H)^2, however many cells the height has.

Sources: O. C. Zienkiewicz, R. L. Taylor, The finite element method, volume 1, 2000, chapter 9 (shear); J. C. Nagtegaal, D. M. Parks,
J. R. Rice, Comput. Methods Appl. Mech. Eng. 4, 1974 (plastic flow keeps the volume).
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.elasticity import once_per_part
from fcsim.assembly.locking.least_box import least_box
from fcsim.assembly.model import Model
from fcsim.assembly.nonlinear.part import laws_of
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.law import Circumstances, PointLaw, initial_variables
from fcsim.mesh.material.linear import Material, Orthotropic
from fcsim.mesh.material.plastic import FinitePlastic, Plastic
from fcsim.mesh.part import Part

LOCKS = 0.49
"""Poisson's ratio from which cells of first order lock by volume: 40 % too stiff in bending at 0.49, 73 % at 0.4999 (docs/elements.md)."""

LONG_LOCKS, LONG = 0.499, 5.0
"""Poisson's ratio and length over height from which simplices of second order do: 6 % at 0.4999 in cells ten times as long as high."""


SLENDER, TOO_STIFF = 4.0, 0.25
"""Longest over smallest extent of a straight part, and by how much it may be too stiff where it bends."""

SAME = 1e-6
"""Of an extent: what is round-off."""

SIMPLICES = 2.5
"""Of (l / H)^2: by how much P1 cells are too stiff, measured on the cantilevers of docs/elements.md (hexahedra cut into six)."""


@once_per_part
def locking(part: Part) -> str:
    """What is to be said of the part's elements and its most nearly incompressible material; "" where there is nothing.

    Poisson's ratio is that of the first stiffness C: (3 K - 2 G) / (6 K + 2 G), 9 K = C_iijj, 30 G = 3 C_ijij - C_iijj (means over all
    directions).
    """
    if part.elements not in ("Q1", "P1", "P2") or (part.dimension == 2 and part.plane == "stress"):
        return ""
    nu = max(_poisson(law, _middle(part, cells)) for law, cells in laws_of(part))
    if part.elements == "P2":
        if nu < LONG_LOCKS or _aspect(part) < LONG:
            return ""
        instead = 'cells that are not as long, or hexahedra with "Q2" or "Q1-enhanced"'
    elif nu < LOCKS:
        return ""
    else:
        instead = '"P2"' if part.elements == "P1" else '"Q1-bbar", or "Q2"'
    return f"part {part.name!r}: {part.elements} elements lock at Poisson's ratio {nu:.4f}: it is too stiff. What helps: {instead}"


@once_per_part
def locking_in_bending(part: Part) -> str:
    """What is to be said of a slender straight part whose cells of first order are too long to bend; "" where there is nothing."""
    if part.elements not in ("Q1", "Q1-bbar", "P1"):
        return ""
    axes = least_box(part.points)  # of the part, which may be meshed where it is to stand, at any angle
    extent = np.ptp(part.points @ axes.T, axis=0)
    height = float(extent[-1])
    if extent[0] < (1 - SAME) * SLENDER * height:
        return ""
    along = axes[extent > (1 - SAME) * extent[0]]  # both of a square plate
    length = float(np.median(np.ptp(part.points[part.cells] @ along.T, axis=1), axis=0).max())
    nu = min(_poisson(law, _middle(part, cells)) for law, cells in laws_of(part))
    shear = 0.5 * (1 - nu) if part.dimension == 2 and part.plane == "strain" else 0.5 / (1 + nu)
    stiffer = (SIMPLICES if part.elements == "P1" else shear) * (length / height) ** 2
    if stiffer < TOO_STIFF:
        return ""
    linear = isinstance(part.material, Material | Orthotropic)  # of which alone there are enhanced cells
    better = '"P2"' if part.elements == "P1" else '"Q1-enhanced" or "Q2"' if linear else '"Q2"'
    return (
        f"part {part.name!r}: {part.elements} cells that are {length / height:.2g} times as long as the part is high: where it bends "
        f"it is too stiff by about {100 * stiffer:.0f} %. What helps: {better}, or shorter cells"
    )


@once_per_part
def locking_in_flow(part: Part) -> str:
    """What is to be said of cells of first order in a material of von Mises' plasticity, whose flow keeps the volume; "" else."""
    if part.elements not in ("Q1", "P1") or (part.dimension == 2 and part.plane == "stress"):
        return ""
    if not any(isinstance(law, Plastic | FinitePlastic) for law, _ in laws_of(part)):
        return ""
    better = '"P2"' if part.elements == "P1" else '"Q1-bbar" or "Q2"'
    return (
        f"part {part.name!r}: {part.elements} elements lock once most of it flows, which keeps the volume: limit loads are too high. "
        f"What helps: {better}"
    )


def _middle(part: Part, cells: IntArray) -> FloatArray:
    """X (1, 3) [m] of a cell: fields need not be finite outside of the body."""
    X = np.zeros((1, 3))
    X[0, : part.dimension] = part.points[part.cells[cells[0]]].mean(axis=0)
    return X


def _poisson(law: PointLaw, X: FloatArray) -> float:
    strain = np.eye(3)[None] if law.strain == "finite" else np.zeros((1, 3, 3))
    answer = law.respond(strain, initial_variables(law)[None], Circumstances(X, 0.0, 0.0), True)
    assert answer.tangent is not None
    C: FloatArray = answer.tangent[0]
    volume, total = float(np.einsum("iijj", C)), float(np.einsum("ijij", C))
    K, G = volume / 9, (3 * total - volume) / 30
    return (3 * K - 2 * G) / (6 * K + 2 * G)


def _aspect(part: Part) -> float:
    ends = part.points[part.cells[:, CELL_TYPES[part.cell_type].edges]]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    return float((length.max(axis=1) / length.min(axis=1)).max())


def locking_parts(model: Model) -> tuple[str, ...]:
    """What is to be said of the parts of a model, each once; bodies that are held wholly do not strain."""
    parts = {id(body.part): body.part for body in model.deformable if not _held_wholly(model, body.name)}
    said = (locking, locking_in_flow, locking_in_bending)
    return tuple(text for part in parts.values() for about in said if (text := about(part)))


def _held_wholly(model: Model, name: str) -> bool:
    """Whether supports of the whole body name all its directions."""
    own = [support for support in model.supports if support.body == name and support.selection.whole]
    directions = {direction for support in own if isinstance(support, Support) and support.axes is None for direction in support.directions}
    return any(isinstance(support, DrivenRotation) for support in own) or directions >= set("xyz"[: model.dimension])
