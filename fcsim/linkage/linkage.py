"""All links of a model as rows g(x) = 0 of points of its bodies: equality constraints G^T v + b = 0 of the mechanics.

A row says dir . (sum_n W_n x_n - o) = length with weights W of nodes that sum to zero (or are held against the ground), so that the
forces dir W l on the bodies have no resultant; G = B^T (W x dir), B v the nodes' velocities. Springs are rows with a compliance.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import NamedTuple, get_args

import numpy as np
from scipy.sparse import csr_array, vstack

from fcsim.arrays import BoolArray, FloatArray, IntArray, is_number, numbers_of
from fcsim.assembly.kinematics.frames import FloatingGroup
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.contact_detection.contacts import CABLES
from fcsim.errors import MODEL, InputError, expect
from fcsim.linkage.links import Ball, Bonded, Cable, Control, Hinge, Link, Rod, Slider, SpringDamper, Tied
from fcsim.linkage.moments import Couple, Couples, gathered, without_moments
from fcsim.linkage.points import nodes_around, weights_at
from fcsim.linkage.rows import Asked, Jointed, asked
from fcsim.linkage.surfaces import bonded_weights, offsets, tied_weights


class Rows(NamedTuple):
    """p rows in a configuration: weights (p, n_nodes), direction (p, d), gap (p,) [m]: how far each is from being kept."""

    weights: csr_array
    direction: FloatArray
    gap: FloatArray


class _Points(NamedTuple):
    """The points of a link: weights (k, n_nodes) of nodes, ground (k, d) where they stand still; rest [m]: a length it has."""

    link: Jointed
    weights: csr_array
    ground: FloatArray
    rest: float


class _Surfaces(NamedTuple):
    """A tied or bonded pair: weights (k, n_nodes), offset (k, d) [m] in the reference, number of the body that it turns with."""

    link: Tied | Bonded
    weights: csr_array
    offset: FloatArray
    body: int


class Linkage:
    """The links of a model, checked: names, places in the bodies, surfaces that meet.

    names: of all links; of_row (p,): which of them each row is of; stiffness (p,) [N/m], inf where the row is kept exactly, and damping
    (p,) [N s/m]; rest (p,) [m]: lengths of rods and springs; driven (p,): whether a row goes a way of its own, see `target`. Cables are
    no rows: `cables`, see `WithCables`.
    """

    def __init__(self, model: Model, links: Sequence[Link]) -> None:
        expect(model, Model, "Linkage, model", MODEL)
        expect(links, Iterable, "Linkage, links", "several, in a list, as [Hinge(...), Rod(...)]")
        self.model, self.links = model, tuple(links)
        for link in self.links:
            expect(link, get_args(Link), "Linkage, links", ", ".join(kind.__name__ for kind in get_args(Link)))
        self.names = tuple(link.name for link in self.links)
        if any(not isinstance(name, str) or not name for name in self.names) or len(set(self.names)) < len(self.names):
            raise InputError(f"linkage: expected different names of links, none empty, got {', '.join(map(shown, self.names))}")
        self._pieces = [_found(model, link) for link in self.links if not isinstance(link, Cable)]
        self.cables = [_points(model, link) for link in self.links if isinstance(link, Cable)]
        number = {name: k for k, name in enumerate(self.names)}
        of_row = [number[piece.link.name] for piece in self._pieces]
        self.of_row: IntArray = np.repeat(np.array(of_row, dtype=np.int64), [_count(piece, model) for piece in self._pieces])
        springs = {number[p.link.name]: p.link for p in self._pieces if isinstance(p.link, SpringDamper)}
        self.stiffness: FloatArray = np.array([springs[k].stiffness if k in springs else np.inf for k in self.of_row.tolist()])
        self.damping: FloatArray = np.array([springs[k].damping if k in springs else 0.0 for k in self.of_row.tolist()])
        rests = {number[p.link.name]: p.rest for p in self._pieces if isinstance(p, _Points)}
        self.rest: FloatArray = np.array([rests.get(k, 0.0) for k in self.of_row.tolist()])
        self._controls = [(number[p.link.name], p.link) for p in self._pieces if isinstance(p.link, Control)]
        self.driven: BoolArray = np.isin(self.of_row, [k for k, _ in self._controls])

    def target(self, t: float) -> FloatArray:
        """The gap (p,) [m] that rows are to have at t [s]: 0 but for what is driven."""
        gap = np.zeros(self.n_rows)
        for k, link in self._controls:
            gap[self.of_row == k] = link.way(t)
        return gap

    @property
    def n_rows(self) -> int:
        return len(self.of_row)

    @property
    def nodes(self) -> IntArray:
        """Sorted numbers of the nodes that links touch."""
        of_points = [piece.weights.indices for piece in (*self._pieces, *self.cables)]
        every = of_points + [couple.nodes for couple in self._couples.nodal]
        return np.unique(np.concatenate([*every, np.empty(0, dtype=np.int64)])).astype(np.int64)

    def rows(self, x: FloatArray, like: Rows | None = None) -> Rows:
        """The rows in the configuration x (n_dofs,). like: those of another one, along whose directions hinges and sliders are measured,
        which have no directions of their own across their axis."""
        return self._rows(self.model.positions(x), x, like)

    @cached_property
    def _points(self) -> tuple[csr_array, FloatArray, IntArray]:
        """All pieces' points: weights (K, n_nodes), ground (K, d), and where each piece's begin."""
        if not self._pieces:
            return csr_array((0, self.model.n_nodes)), np.empty((0, self.model.dimension)), np.zeros(1, dtype=np.int64)
        counts = [piece.weights.shape[0] for piece in self._pieces]
        ground = [np.zeros_like(p.offset) if isinstance(p, _Surfaces) else p.ground for p in self._pieces]
        return vstack([piece.weights for piece in self._pieces], format="csr"), np.concatenate(ground), np.cumsum([0, *counts])

    @cached_property
    def straight(self) -> BoolArray:
        """Which rows (p,) are of rods and springs, whose direction is that of their points."""
        return np.isin(self.of_row, [k for k, link in enumerate(self.links) if isinstance(link, Rod | SpringDamper)])

    def on_lines(self, x: FloatArray) -> Iterator[tuple[Hinge | Slider, int, FloatArray, csr_array]]:
        """Hinges and sliders: where their rows begin, their points (k, d) in the configuration x (n_dofs,) and these points' weights."""
        positions = self.model.positions(x)
        for piece in self._pieces:
            if isinstance(piece, _Points) and isinstance(piece.link, Hinge | Slider):
                first = int(np.searchsorted(self.of_row, self.names.index(piece.link.name)))
                yield piece.link, first, piece.weights @ positions + piece.ground, piece.weights

    def _rows(self, positions: FloatArray, x: FloatArray | None = None, like: Rows | None = None) -> Rows:
        """One sparse product for the rows of all links: their coefficients on all points."""
        weights, ground, first = self._points
        points, d = weights @ positions + ground, self.model.dimension
        columns, values, counts = list[IntArray](), list[FloatArray](), list[IntArray]()
        directions, lengths = list[FloatArray](), list[FloatArray]()
        begin = 0
        for piece, at, end in zip(self._pieces, first[:-1].tolist(), first[1:].tolist(), strict=True):
            if isinstance(piece, _Surfaces):
                offset = piece.offset if x is None else piece.offset @ _rotation(self.model, piece.body, x).T
                column, value, count = np.repeat(np.arange(len(offset)), d), np.ones(offset.size), np.ones(offset.size, dtype=np.int64)
                direction, length = np.tile(np.eye(d), (len(offset), 1)), offset.ravel()
            else:
                wanted: Asked = asked(piece.link, points[at:end], piece.rest)
                there = wanted.coefficients != 0
                column, value, count = np.nonzero(there)[1], wanted.coefficients[there], there.sum(axis=1)
                keeps = like is not None and isinstance(piece.link, Hinge | Slider)
                direction = like.direction[begin : begin + len(count)] if keeps and like is not None else wanted.direction
                length = wanted.length
            columns.append(at + column)
            values.append(value)
            counts.append(count)
            directions.append(direction)
            lengths.append(length)
            begin += len(count)
        if not columns:
            return Rows(csr_array((0, self.model.n_nodes)), np.empty((0, d)), np.empty(0))
        starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
        C = csr_array((np.concatenate(values), np.concatenate(columns), starts), shape=(begin, weights.shape[0]))
        direction = np.concatenate(directions)
        return Rows(csr_array(C @ weights), direction, np.einsum("kd,kd->k", direction, C @ points) - np.concatenate(lengths))

    def matrix(self, rows: Rows, x: FloatArray, *, balanced: bool = True) -> csr_array:
        """G (n_dofs, p) of the rows in the configuration x (n_dofs,); balanced: without moments, see `moments`. What is on its way to a
        configuration where links are closed, as an iterate of statics, is not: its gaps are none of the answer's."""
        d, W = self.model.dimension, rows.weights.tocoo()
        row, node = W.coords
        values = (W.data[:, None] * rows.direction[row]).ravel()
        places = (d * node[:, None] + np.arange(d)).ravel(), np.repeat(row, d)
        nodal = csr_array((values, places), shape=(d * self.model.n_nodes, len(rows.gap)))
        G = csr_array(self.model.contact_matrix(nodal, x))
        return without_moments(self.model, G, x, self._couples) if balanced else G

    @cached_property
    def _couples(self) -> Couples:
        """Who takes what moment the rows of each link between two bodies have."""
        first = np.cumsum([0, *(_count(piece, self.model) for piece in self._pieces)]).tolist()
        found = (_couple(self.model, piece, *rows) for piece, *rows in zip(self._pieces, first[:-1], first[1:], strict=True))
        return gathered(couple for couple in found if couple is not None)

    def cable_identity(self, name: str) -> int | None:
        """The identity of the contact that a cable is, None of other links; InputError where no link has the name."""
        if name not in self.names:
            raise InputError(f"link {name!r}: expected one of {', '.join(map(repr, self.names))}")
        return next((CABLES + k for k, piece in enumerate(self.cables) if piece.link.name == name), None)

    def force(self, name: str, rows: Rows, force: FloatArray) -> FloatArray:
        """Resultant (d,) [N] of the forces (p,) of one link's rows on its first body."""
        link = self.links[self.names.index(name)]
        own = self.of_row == self.names.index(name)
        sign = -1.0 if isinstance(link, Slider) else 1.0  # a slider's rows push the second body
        total: FloatArray = sign * force[own] @ rows.direction[own]
        return total


def _count(piece: _Points | _Surfaces, model: Model) -> int:
    """How many rows a link has."""
    if isinstance(piece, _Surfaces):
        return int(piece.offset.size)
    return len(asked(piece.link, piece.weights @ model.reference + piece.ground, piece.rest).length)


def _couple(model: Model, piece: _Points | _Surfaces, first: int, end: int) -> Couple | None:
    """Who takes what moment the rows `first` to `end` - 1 have; None where the ground does, or they have none.

    Rods and springs pull along the line of their points, and pins of deformable bodies, whose points move as their nodes do, stay closed.
    Surfaces that stand apart turn with the second body, if it turns."""
    link, rigid = piece.link, len(model.deformable)
    if isinstance(link, Control) or None in (link.first, link.second):
        return None
    named = [link.first[0], link.second[0]] if isinstance(link, Tied) else [link.first, link.second]
    bodies = [model.number[str(name)] for name in named]
    own = np.unique(piece.weights.indices)
    if isinstance(piece, _Surfaces):
        second = bodies[1]
        if second >= rigid:
            return Couple(first, end, (second - rigid,), own[:0])
        turns = any(second in group.members and group.rotates for group in model.groups)
        return Couple(first, end, (), own[(own >= model.node_offset[second]) & (own < model.node_offset[second + 1])]) if turns else None
    turning = [b for b in bodies if b >= rigid]
    if turning:
        return Couple(first, end, tuple(b - rigid for b in turning), own[:0])
    if not isinstance(link, Hinge | Slider):
        return None
    places = [*link.ends] if isinstance(link, Hinge) or link.beside is None else [*link.ends, link.beside]
    around = [nodes_around(model, str(name), np.asarray(place, dtype=np.float64), link.name) for name in named for place in places]
    return Couple(first, end, (), np.unique(np.concatenate(around)))


def _rotation(model: Model, body: int, x: FloatArray) -> FloatArray:
    """The rotation (d, d) of a body; the identity for one of small rotations."""
    if body >= len(model.deformable):
        return np.asarray(model.rigid_rotation(x)[body - len(model.deformable)])
    for group in model.nonlinear.groups:
        if body in group.members and group.rotates:
            floating = FloatingGroup(group)
            return np.asarray(floating.frames(x).rotation[group.members == body][0])
    elastic = model.elastic
    return np.asarray(elastic.rotation(elastic.at(x))[body]) if elastic.turning else np.eye(model.dimension)


def _found(model: Model, link: Link) -> _Points | _Surfaces:
    what = f"{type(link).__name__} {link.name!r}"
    if isinstance(link, Tied):
        weights = tied_weights(model, link, what)
        return _Surfaces(link, weights, offsets(weights, model.reference), model.number[link.second[0]])
    if isinstance(link, Bonded):
        weights = bonded_weights(model, link, what)
        return _Surfaces(link, weights, offsets(weights, model.reference), model.number[link.second])
    return _points(model, link)


def _places(model: Model, link: Ball | Hinge | Slider | Rod | Cable | SpringDamper, what: str) -> list[FloatArray]:
    """The places (d,) [m] that the link names, checked with its bodies."""
    for body in (link.first, link.second):
        if body is not None:
            model.body_number(body)  # refuses unknown names
    if link.first == link.second:
        raise InputError(f"{what}: expected two different bodies, got {link.first!r} twice")
    if not isinstance(link, Ball) and (not isinstance(link.ends, tuple | list | np.ndarray) or len(link.ends) != 2):
        raise InputError(f"{what}: expected two ends, places in m, got {shown(link.ends)}")
    places = [_place(model, place, what) for place in ([link.at] if isinstance(link, Ball) else link.ends)]
    if len(places) == 2 and np.linalg.norm(places[1] - places[0]) <= 1e-9 * np.ptp(model.reference, axis=0).max():
        raise InputError(f"{what}: expected two ends apart from each other, got both at {places[0].tolist()}")
    if isinstance(link, Slider) and link.beside is not None:
        places.append(_place(model, link.beside, what))
        off = np.linalg.norm(np.cross(places[1] - places[0], places[2] - places[0])) if model.dimension == 3 else 0.0
        if not off > 1e-9 * np.linalg.norm(places[1] - places[0]) ** 2:
            raise InputError(f"{what}: expected a place beside the line, in 3D, got {places[2].tolist()}")
    return places


def _points(model: Model, link: Jointed) -> _Points:
    """The link's points: at each of its places the first body's and the second's, of rods, cables and springs one at each end."""
    what = f"{type(link).__name__} {link.name!r}"
    if isinstance(link, Control):
        return _controlled(model, link, what)
    if isinstance(link, Hinge) and model.dimension == 2:
        raise InputError(f"{what}: expected a model in 3D, in 2D a Ball is a pin")
    places = _places(model, link, what)
    if isinstance(link, Rod | Cable | SpringDamper):
        held = [(link.first, places[0]), (link.second, places[1])]
    else:
        held = [(body, place) for place in places for body in (link.first, link.second)]
    ground, entries = np.zeros((len(held), model.dimension)), []
    for k, (body, place) in enumerate(held):
        if body is None:
            ground[k] = place
            continue
        nodes, weights = weights_at(model, body, place, what)
        entries.append((weights, np.full(len(nodes), k), nodes))
    values, rows, columns = (np.concatenate(column) for column in zip(*entries, strict=True))
    return _Points(link, csr_array((values, (rows, columns)), shape=(len(held), model.n_nodes)), ground, _rest(link, places, what))


def _controlled(model: Model, link: Control, what: str) -> _Points:
    """The points of a control, which have no fellows."""
    points = link.points if isinstance(link.points, tuple | list) else (link.points,)
    for point in points:
        if not (isinstance(point, tuple | list) and len(point) == 3):
            raise InputError(f"{what}: expected points (body, place, weight), got {shown(point)}")
        if not (is_number(point[2]) and point[2] > 0):
            raise InputError(f"{what}: expected points with weights > 0, got {shown(point[2])}")
    if not points:
        raise InputError(f"{what}: expected points (body, place, weight), got none")
    weights = np.array([weight for _, _, weight in points], dtype=np.float64)
    along = _place(model, link.direction, f"{what}, direction")
    if not (np.linalg.norm(along) > 0 and is_number(link.rate)):
        raise InputError(f"{what}: expected a direction and a rate [m/s], 0 holds, got {along.tolist()} and {shown(link.rate)}")
    if link.displacement is not None and (link.rate or not callable(link.displacement) or link.way(0.0) != 0):
        raise InputError(
            f"{what}: expected a rate or a displacement, a function of the time that is 0 at t = 0, got {link.rate}, {link.displacement!r}"
        )
    entries = []
    for k, (body, place, _) in enumerate(link.points):
        nodes, shares = weights_at(model, body, _place(model, place, what), what)
        entries.append((shares, np.full(len(nodes), k), nodes))
    values, rows, columns = (np.concatenate(column) for column in zip(*entries, strict=True))
    W = csr_array((values, (rows, columns)), shape=(len(weights), model.n_nodes))
    begin = float(along / np.linalg.norm(along) @ (W @ model.reference).T @ (weights / weights.sum()))
    return _Points(link, W, np.zeros((len(weights), model.dimension)), begin)


def _place(model: Model, place: tuple[float, ...], what: str) -> FloatArray:
    found = numbers_of(place)
    if found.shape != (model.dimension,) or not np.all(np.isfinite(found)):
        raise InputError(f"{what}: expected places of {model.dimension} finite numbers in m, got {shown(place)}")
    return found


def _rest(link: Jointed, places: list[FloatArray], what: str) -> float:
    """The length of a rod, cable or spring."""
    if not isinstance(link, Rod | Cable | SpringDamper):
        return 0.0
    if isinstance(link, SpringDamper):
        numbers = link.stiffness, link.damping
        if not all(is_number(n) and n >= 0 for n in numbers) or not any(numbers):
            raise InputError(
                f"{what}: expected a stiffness [N/m] and a damping [N s/m] >= 0, not both 0, got {shown(numbers[0])}, {shown(numbers[1])}"
            )
    length = None if isinstance(link, Rod) else link.length
    if length is not None and not (is_number(length) and length >= 0):
        raise InputError(f"{what}: expected a length >= 0 in m, got {shown(length)}")
    return float(np.linalg.norm(places[1] - places[0])) if length is None else float(length)
