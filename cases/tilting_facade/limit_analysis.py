"""The tilt at which the facade falls, by limit analysis: linear programs over the forces in its joints.

python cases/tilting_facade/limit_analysis.py

The facade stands at the slope s = tan(angle) if there are forces in all joints, pressing at both ends and within the cone of friction, that
balance each block's weight W (s, -1) (J. Heyman, The stone skeleton, Int. J. Solids Struct. 2, 1966; with friction: R. K. Livesley, Limit
analysis of structures formed from rigid blocks, Int. J. Numer. Meth. Eng. 12, 1978). The largest such slope is the limit of blocks that
dilate as they slide, and no facade stands beyond. Coulomb's do not dilate and may fall before: their slope is estimated by cones replaced
with nearly flat ones through the forces found, until both agree (M. Gilbert, C. Casapulla, H. M. Ahmed, Limit analysis of masonry block
structures with non-associative frictional joints using linear programming, Comput. Struct. 84, 2006).
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array, lil_array

from fcsim import FloatArray

_DILATES = 0.01  # share of the friction that the flat cones keep
_KEEPS = 0.6  # share of the last normal forces in the next ones
_ROUNDS = 100


class Joint(NamedTuple):
    """A bed (or head) joint of `block` on what is below (or left of) it, `other`, -1 = the table; its ends in columns and rows."""

    block: int
    other: int
    ends: tuple[tuple[float, float], tuple[float, float]]
    bed: bool


def joints(blocks: Sequence[tuple[int, int, int]], rows: int, columns: int) -> list[Joint]:
    """All joints of blocks (row, first column, last column)."""
    owner = np.full((rows, columns), -2)
    for k, (row, first, last) in enumerate(blocks):
        owner[row, first:last] = k
    ends: dict[tuple[int, int, bool], list[tuple[float, float]]] = {}
    for row, column in np.argwhere(owner >= 0).tolist():
        a = int(owner[row, column])
        below = -1 if row == 0 else int(owner[row - 1, column])
        left = -2 if column == 0 else int(owner[row, column - 1])
        if below > -2:
            ends.setdefault((a, below, True), []).extend([(column, row), (column + 1, row)])
        if left > -2 and left != a:
            ends.setdefault((a, left, False), []).extend([(column, row), (column, row + 1)])
    return [Joint(a, b, (min(points), max(points)), bed) for (a, b, bed), points in ends.items()]


def equilibrium(blocks: Sequence[tuple[int, int, int]], found: Sequence[Joint], half: tuple[float, float]) -> tuple[csr_array, FloatArray]:
    """A, b of A x = b, with three rows a block and x = (normal at both ends, tangential) of each joint and at last the slope.

    half: width and height of half a block; forces in weights of half a block.
    """
    A, b = lil_array((3 * len(blocks), 3 * len(found) + 1)), np.zeros(3 * len(blocks))
    for k, (_, first, last) in enumerate(blocks):
        A[3 * k, 3 * len(found)], b[3 * k + 1] = last - first, last - first
    for j, joint in enumerate(found):
        normal, tangent = ((0.0, 1.0), (1.0, 0.0)) if joint.bed else ((1.0, 0.0), (0.0, 1.0))
        forces = [(joint.ends[0], normal), (joint.ends[1], normal), (joint.ends[0], tangent)]
        for body, sign in ((joint.block, 1.0), (joint.other, -1.0)):
            if body < 0:
                continue
            row, first, last = blocks[body]
            for place, (end, direction) in enumerate(forces):
                arm = np.array(half) * (end[0] - 0.5 * (first + last), end[1] - row - 0.5)
                moment = arm[0] * direction[1] - arm[1] * direction[0]
                A[3 * body : 3 * body + 3, 3 * j + place] = sign * np.array([direction[0], direction[1], moment])
    return A.tocsr(), b


def largest_slope(A: csr_array, b: FloatArray, mu: float, cohesion: FloatArray) -> Any:
    """The solution with the largest slope under |T| <= mu (N1 + N2) + cohesion (nj,)."""
    count = len(cohesion)
    cone = np.zeros((2 * count, 3 * count + 1))
    for j in range(count):
        for side, sign in ((2 * j, 1.0), (2 * j + 1, -1.0)):
            cone[side, 3 * j : 3 * j + 3] = -mu, -mu, sign
    objective = np.zeros(3 * count + 1)
    objective[-1] = -1.0
    bounds = [(0, None), (0, None), (None, None)] * count + [(None, None)]
    answer = linprog(objective, A_ub=csr_array(cone), b_ub=np.repeat(cohesion, 2), A_eq=A, b_eq=b, bounds=bounds)
    if answer.status != 0:
        raise ArithmeticError(f"limit analysis: {answer.message}")
    return answer.x


def limit_tilts(case: ModuleType, mu: float, half: tuple[float, float, float]) -> tuple[float, float]:
    """Degrees at which the case's facade falls with friction mu: with dilatancy (no facade stands beyond), and without."""
    blocks, rows, columns = case.blocks(), len(case.LAYOUT), len(case.LAYOUT[0])
    found = joints(blocks, rows, columns)
    A, b = equilibrium(blocks, found, half[:2])
    x = largest_slope(A, b, mu, np.zeros(len(found)))
    most = last = float(x[-1])
    pressed = x[:-1].reshape(-1, 3)[:, :2].sum(axis=1)
    for _ in range(_ROUNDS):
        x = largest_slope(A, b, _DILATES * mu, (1 - _DILATES) * mu * pressed)
        pressed = _KEEPS * pressed + (1 - _KEEPS) * x[:-1].reshape(-1, 3)[:, :2].sum(axis=1)
        if abs(x[-1] - last) < 1e-4 * last:
            break
        last = float(x[-1])
    return float(np.rad2deg(np.arctan(most))), float(np.rad2deg(np.arctan(x[-1])))


def _case() -> ModuleType:
    spec = importlib.util.spec_from_file_location("tilting_facade", Path(__file__).parent / "tilting_facade.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    case = _case()
    for mu in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0):
        with_dilatancy, without = limit_tilts(case, mu, case.Parameters().half)
        print(f"mu = {mu:g}: {with_dilatancy:.2f} degrees with dilatancy, {without:.2f} without")
