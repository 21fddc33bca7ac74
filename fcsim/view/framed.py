"""What pictures of a run show: all that moves, in every instant, and of wide floors what is near it; and how far displacements may be
exaggerated before bodies that touch lie in each other, or grow as they turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray

if TYPE_CHECKING:
    from pyvista import DataSet

_WIDE = 1.5  # times as long as what moves: a body that stands still is cut off there
_AROUND = 0.1  # of the largest extent of what moves
_ENTERED = 0.05  # share of the smaller body's extent that bodies may be drawn into each other
_GROWN = 0.05  # share by which a body that turns may be drawn larger
_TOUCHING = 1e-6  # of the whole: boxes that are nearer touch
_PAIRS = 1 << 20  # of bodies that are looked at together


@dataclass(eq=False)
class Framed:
    """Boxes of bodies over the instants that are shown: boxes[body] is (6, 3), least and largest reference x, displacement u and x + u [m].

    All deformable blocks are one body, -1. The extremes of x + e u over points are not linear in e: those of x and of u bound them.
    """

    boxes: dict[int, FloatArray] = field(default_factory=dict)
    _closing: list[FloatArray] = field(default_factory=list)
    _turned: float = 0.0
    _boxes_factor: float = np.inf

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

    def see_motion(self, bodies: Sequence[DataSet], contacts: DataSet | None) -> None:
        """Take in how the bodies of an instant's data sets have turned, and by how much the gaps of its contacts have closed, and those
        between bodies that no contact has: what falls on to a floor and has not come there.

        A gap is (x_slave - x_master) . n; before, with displacements u, it was that less (u_slave - u_master) . n. Their u are those of the
        rigid motions that fit the bodies' points best (Kabsch 1976); what deformable bodies deviate from these closes no gap.
        """
        numbered = [data for data in bodies if data.n_points and "body" in data.cell_data]
        if not numbered:
            return
        body = np.concatenate([np.rint(data.cell_data_to_point_data()["body"]).astype(int) for data in numbered])
        numbers, own = np.unique(body, return_inverse=True)
        x, u = (np.concatenate([np.asarray(of(data), dtype=np.float64) for data in numbered]) for of in (_reference, _displacement))
        motion = _Motions.fitted(x, u, own)
        self._turned = max(self._turned, float(np.sum((motion.turn - np.eye(3)) ** 2, axis=(1, 2)).max()) / 2)
        none = np.empty((0, 2), dtype=np.intp)
        if contacts is None or not contacts.n_points:
            self._boxes_factor = min(self._boxes_factor, _factor_of_boxes(x, own, motion, none))
            return
        if not {"slave", "master", "normal", "gap"} <= set(contacts.point_data):
            return  # files of fcsim 0.2
        pairs = np.column_stack([contacts["slave"], contacts["master"]])
        known = np.isin(pairs, numbers).all(axis=1)
        slave, master = between = np.searchsorted(numbers, pairs[known]).T
        self._boxes_factor = min(self._boxes_factor, _factor_of_boxes(x, own, motion, between.T))
        place, n = (np.asarray(values, dtype=np.float64)[known] for values in (contacts.points, contacts["normal"]))
        approach = np.einsum("ki,ki->k", motion.displacement(master, place) - motion.displacement(slave, place), n)
        closed = approach - motion.deformed[slave] - motion.deformed[master]
        bearable = _ENTERED * np.minimum(motion.extent[slave], motion.extent[master])
        gap = np.asarray(contacts["gap"], dtype=np.float64)[known]
        self._closing.append(np.column_stack([gap + closed + bearable, closed])[closed > 0])

    @property
    def largest_factor(self) -> float:
        """The largest factor on displacements that misleads nobody, 1 at least: under it no gap that closes is drawn as an overlap of more
        than a twentieth of the smaller body, be it of a contact or of bodies apart, and no body grows by more than a twentieth as it
        turns."""
        factor = self._boxes_factor
        if self._turned > 0:  # |x + f (turn - 1) x|^2 <= |x|^2 (1 + f (f - 1) |turn - 1|^2 / 2)
            factor = min(factor, (1 + np.sqrt(1 + 4 * ((1 + _GROWN) ** 2 - 1) / self._turned)) / 2)
        for bearable, closed in (one.T for one in self._closing if len(one)):
            factor = min(factor, float((bearable / closed).min()))
        return max(1.0, float(factor))


@dataclass(frozen=True, eq=False)
class _Motions:
    """Rigid motions x -> after + turn (x - before) of bodies (nb,), the largest deviation [m] of their points, their extents [m]."""

    before: FloatArray
    after: FloatArray
    turn: FloatArray
    deformed: FloatArray
    extent: FloatArray

    @classmethod
    def fitted(cls, x: FloatArray, u: FloatArray, own: NDArray[np.intp]) -> _Motions:
        """Of points x (n, 3) with displacements u, of which each has its body."""
        count, y = np.bincount(own), x + u
        before, after = (np.column_stack([np.bincount(own, values[:, k]) for k in range(3)]) / count[:, None] for values in (x, y))
        products = np.zeros((len(count), 3, 3))
        np.add.at(products, own, (x - before[own])[:, :, None] * (y - after[own])[:, None, :])
        left, _, right = np.linalg.svd(products)
        left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
        turn = np.swapaxes(left @ right, 1, 2)
        deformed, least, most = np.zeros(len(count)), np.full((len(count), 3), np.inf), np.full((len(count), 3), -np.inf)
        np.maximum.at(deformed, own, np.linalg.norm(y - after[own] - np.einsum("kij,kj->ki", turn[own], x - before[own]), axis=1))
        np.minimum.at(least, own, x)
        np.maximum.at(most, own, x)
        return cls(before, after, turn, deformed, (most - least).max(axis=1))

    def displacement(self, body: NDArray[np.intp], y: FloatArray) -> FloatArray:
        """Displacements (k, 3) of the points of bodies (k,) that are at y (k, 3) now."""
        moved: FloatArray = y - self.before[body] - np.einsum("kji,kj->ki", self.turn[body], y - self.after[body])
        return moved


def _factor_of_boxes(x: FloatArray, own: NDArray[np.intp], motion: _Motions, met: NDArray[np.intp]) -> float:
    """The largest factor on displacements under which no two boxes that lie apart are drawn into each other by more than is borne: they
    stay apart as long as they do along one axis, moved as their centres are. Points x (n, 3), of which each has its `own` body; left out
    are boxes that touch from the beginning, and the pairs (k, 2) that have `met` in a contact, which says more."""
    count, u = len(motion.extent), motion.after - motion.before
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, own, x)
    np.maximum.at(high, own, x)
    near = _TOUCHING * float((high.max(0) - low.min(0)).max())
    known = np.unique(np.concatenate([met[:, 0] * count + met[:, 1], met[:, 1] * count + met[:, 0]]))
    factor, rows = np.inf, max(1, _PAIRS // count)
    for begin in range(0, count, rows):
        some = np.arange(begin, min(begin + rows, count))
        borne = _ENTERED * np.minimum(motion.extent[some, None], motion.extent)
        kept, apart = np.zeros((len(some), count)), np.zeros((len(some), count), dtype=bool)
        for axis in range(3):
            for sign, one, other in ((1.0, high, low), (-1.0, -low, -high)):  # the other lies above, or below
                gap = other[:, axis] - one[some, axis, None]
                closed = sign * (u[some, axis, None] - u[:, axis])
                with np.errstate(divide="ignore", invalid="ignore"):
                    until = np.where(closed > 0, (np.maximum(gap, 0.0) + borne) / closed, np.inf)
                kept, apart = np.maximum(kept, np.where(gap > -near, until, 0.0)), apart | (gap > near)
        kept[~apart] = np.inf
        kept.ravel()[known[(known >= begin * count) & (known < (begin + len(some)) * count)] - begin * count] = np.inf
        factor = min(factor, float(kept.min()))
    return factor


def _reference(data: DataSet) -> FloatArray:
    points: FloatArray = data.points
    return points


def _displacement(data: DataSet) -> FloatArray:
    displacement: FloatArray = data["displacement"]
    return displacement
