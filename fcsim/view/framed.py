"""What pictures of a run show: all that moves, in every instant, and of wide floors what is near it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from fcsim.arrays import FloatArray

if TYPE_CHECKING:
    from pyvista import DataSet

_WIDE = 1.5  # times as long as what moves: a body that stands still is cut off there
_AROUND = 0.1  # of the largest extent of what moves


@dataclass(eq=False)
class Framed:
    """Boxes of bodies over the instants that are shown: boxes[body] is (6, 3), least and largest reference x, displacement u and x + u [m].

    All deformable blocks are one body, -1. The extremes of x + e u over points are not linear in e: those of x and of u bound them.
    """

    boxes: dict[int, FloatArray] = field(default_factory=dict)

    def see(self, data: DataSet, rigid: bool) -> None:
        """Take in the data set of an instant's blocks or rigid bodies."""
        if not data.n_points:
            return
        x, u = np.asarray(data.points, dtype=np.float64), np.asarray(data["displacement"], dtype=np.float64)
        body = np.full(len(x), -1)
        if rigid and "body" in data.cell_data:
            body = np.rint(data.cell_data_to_point_data()["body"]).astype(int)
        for number in np.unique(body):
            own = body == number
            new = np.array([f(values[own], axis=0) for values in (x, u, x + u) for f in (np.min, np.max)])
            old = self.boxes.get(int(number), new)
            self.boxes[int(number)] = np.stack([(np.minimum, np.maximum)[k % 2](old[k], new[k]) for k in range(6)])

    @property
    def every(self) -> FloatArray:
        """(bodies, 6, 3)"""
        return np.array(list(self.boxes.values()))

    @property
    def size(self) -> float:
        """The largest extent of all bodies in the reference configuration [m]."""
        return float((self.every[:, 1].max(0) - self.every[:, 0].min(0)).max())

    @property
    def planar(self) -> bool:
        return bool(np.ptp(self.every[:, :2, 2]) == 0)

    def box(self, factor: float) -> tuple[FloatArray, FloatArray]:
        """Corners of the box that is shown (3,) [m] with displacements times `factor`."""
        every = self.every
        low, high = every[:, 0] + factor * np.minimum(every[:, 2], 0), every[:, 1] + factor * np.maximum(every[:, 3], 0)
        if factor == 1.0:
            low, high = every[:, 4], every[:, 5]
        moves = np.any(every[:, 2:4] != 0, axis=(1, 2)) | np.array([number < 0 for number in self.boxes])
        if moves.any() and not moves.all():
            least, most = low[moves].min(0), high[moves].max(0)
            around = _AROUND * float((most - least).max())
            wide = ~moves[:, None] & (high - low > _WIDE * (most - least))
            low, high = np.where(wide, np.maximum(low, least - around), low), np.where(wide, np.minimum(high, most + around), high)
        lowest: FloatArray = low.min(0)
        highest: FloatArray = high.max(0)
        return lowest, highest
