"""Links in a step that is solved again until they are closed where the next step begins."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.timestep.chain import Attempt
from fcsim.timestep.links.linked import Linked
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

CLOSED = 1e-10
"""Of the model's size: how far a link may be from closed at the end of a step."""

TURNED = 1e-11
"""Of a unit force: by how much directions of links may differ from one round to the next where deformable bodies are linked; moments of
momentum are off by so much of the link's impulse times the model's size."""

SETTLED, BORNE = 4, 1e-9
"""After so many rounds directions that go on changing by no more than this are those of a solver's tolerance."""

ROUNDS, ROUNDS_OF_STATICS = 12, 40

MIXED, INDEPENDENT = 3, 1e-8
"""Rounds whose differences are mixed, and the least share of the largest of them that counts."""

FARTHEST = 1.0
"""Of a round of statics: the angle [rad] by which it turns rigid bodies, and the share of their length by which rods and springs are
lengthened or turned, at the most; how forces turn is known for less only."""

BALANCED, BORNE_BY_STATICS = 1e-8, 1e-5
"""Of the largest force of a link: what the forces of links of one round of statics and those of the next may differ by; after `ROUNDS`."""


class _Round(NamedTuple):
    """What an answer of the step shows: the rows of its next solve, what is left of the larger of the opening and the change of the rows,
    relative to what both are measured by, and whether that is nothing that counts."""

    rows: Linked
    left: float
    closed: bool


class Closing:
    """The rows of a step in dynamics while it is solved again until they are closed; given_up: they are not, and the step is to be cut."""

    _most = ROUNDS

    def __init__(self, rows: Linked | None, model: Model, scheme: Scheme, before: State, extent: float) -> None:
        """before: the state that the step begins in; extent [m]: size of the model."""
        self.rows, self.given_up = rows, False
        self._model, self._scheme, self._before, self._extent = model, scheme, before, extent
        self._rounds, self._left = 0, 0.0
        self._mixed = False
        self._past: list[tuple[FloatArray, FloatArray]] = []  # b of the rounds so far and what each adds, newest last

    def impulse(self, multiplier: FloatArray | None) -> FloatArray | float:
        """G l (n_dofs,) [N s; quasi-statics: N]."""
        return 0.0 if self.rows is None or multiplier is None else np.asarray(self.rows.G @ multiplier)

    def keep(self, v: FloatArray, l: FloatArray | None, after: State) -> bool:
        """Whether the links are closed by the step's answer v (n_dofs,), l (p,), which ends in the state `after`, and their forces act
        where they are meant to; where not, `rows` are those of its next solve, or the step is given up.

        InputError where the answer does not keep the rows as they are: links that contradict each other or the supports.
        """
        if self.rows is None:
            return True
        later, self._left, closed = self._round(self.rows, v, np.zeros(0) if l is None else l, after)
        if closed:
            return True
        self._rounds += 1
        self.given_up = self._rounds > self._most
        if not self.given_up:
            self.rows = later
        return False

    def attempt(self, share: float) -> Attempt:
        """The note of a step, or the share of one, that is given up."""
        return Attempt("links", "the free motion", "did not close", self._left, self._most, share, CLOSED)

    def _round(self, rows: Linked, v: FloatArray, l: FloatArray, after: State) -> _Round:
        """Directions of links are taken anew about the answer, by fixed-point iteration."""
        model, scheme, extent = self._model, self._scheme, self._extent
        if not self._mixed:  # mixing may lead off what can be kept together, where rounds add the same again and again
            rows.refuse_contradictions(v, scheme.timing, extent)
        missing = rows.missing(model, scheme, v, after)
        worst = float(np.abs(missing).max(initial=0.0)) / extent
        later = self._sooner(rows, rows.bent(model, scheme, v, (self._before, after), missing))
        change = rows.change(later, model, scheme, extent)
        return _Round(later, max(worst, change), worst <= CLOSED and change <= (TURNED if self._rounds < SETTLED else BORNE))

    def _sooner(self, rows: Linked, later: Linked) -> Linked:
        """The `later` rows of rigid bodies, whose directions stay, by Anderson's mixing: b + f less (dB + dF) c, c the least squares of
        dF c = f, f = later.b - b what a round adds, dB and dF the differences of `MIXED` rounds. By b + f alone what bodies that spin turn
        by in a step is the rate of convergence. Where f grows, mixing has gone astray: back to the best b, which takes its own f.

        Source: D. G. Anderson, Iterative procedures for nonlinear integral equations, Journal of the ACM 12, 1965.
        """
        if later.G is not rows.G:
            return later
        b, f = rows.b, later.b - rows.b
        if self._past and np.linalg.norm(f) > np.linalg.norm(self._past[-1][1]):  # contacts have changed, or mixing went astray
            astray, (b0, f0) = len(self._past) > 1, self._past[-1]
            self._past = [] if astray else [(b, f)]
            return replace(later, b=b0 + f0) if astray else later
        self._past = [*self._past[-MIXED:], (b, f)]
        if len(self._past) < 2:
            return later
        self._mixed = True
        dB, dF = (np.diff(np.stack(values, axis=1), axis=1) for values in zip(*self._past, strict=True))
        c = np.linalg.lstsq(dF, f, rcond=INDEPENDENT)[0]
        return replace(later, b=b + f - (dB + dF) @ c)


class ClosingInStatics(Closing):
    """The same in statics: Newton's method on the links with the geometric stiffness of their forces, no farther a round than
    `FARTHEST`."""

    _most = ROUNDS_OF_STATICS

    def __init__(self, rows: Linked | None, model: Model, scheme: Scheme, before: State, extent: float) -> None:
        super().__init__(rows, model, scheme, before, extent)
        self._at: FloatArray | None = None  # increments (n_dofs,) at which the rows were taken; None: at the beginning

    def _round(self, rows: Linked, v: FloatArray, l: FloatArray, after: State) -> _Round:
        model, scheme, extent, x = self._model, self._scheme, self._extent, self._before.x
        begin = np.zeros_like(v) if self._at is None else self._at
        way = v - begin
        far = rows.reach(model, x, begin, way, extent)
        if far > FARTHEST and self._rounds < ROUNDS_OF_STATICS:
            self._at = v - (1 - FARTHEST / far) * way
            return _Round(rows.at(model.advance(x, self._at), self._at, l), far, closed=False)
        rows.refuse_contradictions(v, scheme.timing, extent)
        worst = float(np.abs(rows.missing(model, scheme, v, after)).max(initial=0.0)) / extent
        later, self._at = rows.at(after.x, v, l), v
        change = rows.unbalanced(later, model, l, extent)
        balanced = change <= BALANCED or (change <= BORNE_BY_STATICS and self._rounds >= ROUNDS)
        return _Round(later, max(worst, change), worst <= CLOSED and balanced)


def closing(rows: Linked | None, model: Model, scheme: Scheme, before: State, extent: float) -> Closing:
    """What closes the rows of a step, by its scheme: in dynamics or in statics; rows: None where there are no links."""
    kind = Closing if scheme.timing.moving else ClosingInStatics
    return kind(rows, model, scheme, before, extent)
