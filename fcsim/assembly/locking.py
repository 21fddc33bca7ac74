"""Elements that hold nearly incompressible materials too stiff, named as a run begins."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.elasticity import once_per_part
from fcsim.assembly.model import Model
from fcsim.assembly.nonlinear.part import laws_of
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.law import Circumstances, PointLaw, initial_variables
from fcsim.mesh.part import Part

LOCKS = 0.49
"""Poisson's ratio from which cells of first order lock by volume: 40 % too stiff in bending at 0.49, 73 % at 0.4999 (docs/elements.md)."""

LONG_LOCKS, LONG = 0.499, 5.0
"""Poisson's ratio and length over height from which simplices of second order do: 6 % at 0.4999 in cells ten times as long as high."""


@once_per_part
def locking(part: Part) -> str:
    """What is to be said of the part's elements and its most nearly incompressible material; "" where there is nothing.

    Poisson's ratio is that of the first stiffness C: (3 K - 2 G) / (6 K + 2 G), 9 K = C_iijj, 30 G = 3 C_ijij - C_iijj (means over all
    directions).
    """
    if part.elements not in ("Q1", "P1", "P2") or (part.dimension == 2 and part.plane == "stress"):
        return ""
    nu = max(_poisson(law) for law, _ in laws_of(part))
    if part.elements == "P2":
        if nu < LONG_LOCKS or _aspect(part) < LONG:
            return ""
        instead = 'cells that are not as long, or hexahedra with "Q2" or "Q1-enhanced"'
    elif nu < LOCKS:
        return ""
    else:
        instead = '"P2"' if part.elements == "P1" else '"Q1-bbar", or "Q2"'
    return f"part {part.name!r}: {part.elements} elements lock at Poisson's ratio {nu:.4f}: it is too stiff. What helps: {instead}"


def _poisson(law: PointLaw) -> float:
    strain = np.eye(3)[None] if law.strain == "finite" else np.zeros((1, 3, 3))
    answer = law.respond(strain, initial_variables(law)[None], Circumstances(np.zeros((1, 3)), 0.0, 0.0), True)
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
    """What is to be said of the parts of a model, each once."""
    parts = {id(body.part): body.part for body in model.deformable}
    return tuple(text for part in parts.values() if (text := locking(part)))
