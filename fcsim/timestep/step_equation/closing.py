"""Links in a step that is solved again until they are closed where the next step begins."""

from __future__ import annotations

from dataclasses import replace

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


class Closing:
    """The rows of a step while it is solved again until they are closed; given_up: they are not, and the step is to be cut."""

    def __init__(self, rows: Linked | None, extent: float) -> None:
        """extent [m]: size of the model."""
        self.rows, self._extent, self._rounds, self.given_up = rows, extent, 0, False
        self._at = np.empty(0)  # increments at which rows of statics were taken; empty: none
        self._past: list[tuple[FloatArray, FloatArray]] = []  # b of the rounds so far and what each adds, newest last

    def impulse(self, multiplier: FloatArray | None) -> FloatArray | float:
        """G l (n_dofs,) [N s; quasi-statics: N]."""
        return 0.0 if self.rows is None or multiplier is None else np.asarray(self.rows.G @ multiplier)

    def keep(
        self,
        model: Model,
        scheme: Scheme,
        v: FloatArray,
        l: FloatArray | None,
        ends: tuple[State, State],
        attempts: list[Attempt],
        share: float,
    ) -> bool:
        """Whether the links are closed after the step's answer v (n_dofs,), l (p,), from the one of `ends` to the other, and their forces
        act where they are meant to; where not, `rows` are those of its next solve.

        InputError where the answer does not keep the rows as they are: links that contradict each other or the supports.
        """
        if self.rows is None:
            return True
        if not scheme.timing.moving:
            return self._keep_in_statics(self.rows, model, scheme, v, np.zeros(0) if l is None else l, ends, attempts, share)
        self.rows.refuse_contradictions(v, scheme.timing.length_per_u, self._extent)
        missing = self.rows.missing(model, scheme, v, ends[1])
        worst = float(np.abs(missing).max(initial=0.0)) / self._extent
        later = self._sooner(self.rows, self.rows.bent(model, scheme, v, ends, missing))
        change = self.rows.change(later, model, scheme, self._extent)
        if worst <= CLOSED and change <= (TURNED if self._rounds < SETTLED else BORNE):
            return True
        return self._again(later, max(worst, change), ROUNDS, attempts, share)

    def _sooner(self, rows: Linked, later: Linked) -> Linked:
        """The `later` rows of rigid bodies, whose directions stay, by Anderson's mixing: b + f less (dB + dF) c, c the least squares of
        dF c = f, f = later.b - b what a round adds, dB and dF the differences of `MIXED` rounds. By b + f alone what bodies that spin turn
        by in a step is the rate of convergence."""
        if later.G is not rows.G:
            return later
        b, f = rows.b, later.b - rows.b
        grows = bool(self._past) and np.linalg.norm(f) > np.linalg.norm(self._past[-1][1])  # contacts have changed
        self._past = [*([] if grows else self._past[-MIXED:]), (b, f)]
        if len(self._past) < 2:
            return later
        dB, dF = (np.diff(np.stack(values, axis=1), axis=1) for values in zip(*self._past, strict=True))
        c = np.linalg.lstsq(dF, f, rcond=INDEPENDENT)[0]
        return replace(later, b=b + f - (dB + dF) @ c)

    def _keep_in_statics(
        self,
        rows: Linked,
        model: Model,
        scheme: Scheme,
        v: FloatArray,
        l: FloatArray,
        ends: tuple[State, State],
        attempts: list[Attempt],
        share: float,
    ) -> bool:
        """`keep` in statics: Newton's method on the links with the geometric stiffness of their forces, a round no farther than
        `FARTHEST`."""
        before, after = ends
        way = v - self._at if len(self._at) else v
        far = rows.reach(model, before.x, self._at if len(self._at) else np.zeros_like(v), way, self._extent)
        if far > FARTHEST and self._rounds < ROUNDS_OF_STATICS:
            self._at = v - (1 - FARTHEST / far) * way
            return self._again(rows.at(model.advance(before.x, self._at), self._at, l), far, ROUNDS_OF_STATICS, attempts, share)
        rows.refuse_contradictions(v, scheme.timing.length_per_u, self._extent)
        worst = float(np.abs(rows.missing(model, scheme, v, after)).max(initial=0.0)) / self._extent
        later, self._at = rows.at(after.x, v, l), v
        change = rows.unbalanced(later, model, l, self._extent)
        if worst <= CLOSED and (change <= BALANCED or (change <= BORNE_BY_STATICS and self._rounds >= ROUNDS)):
            return True
        return self._again(later, max(worst, change), ROUNDS_OF_STATICS, attempts, share)

    def _again(self, later: Linked, left: float, rounds: int, attempts: list[Attempt], share: float) -> bool:
        """False; the `later` rows are those of the next solve, or the step is given up after so many `rounds`."""
        self._rounds += 1
        if self._rounds > rounds:
            self.given_up = True
            attempts.append(Attempt("links", "the free motion", "did not close", left, rounds, share, CLOSED))
            return False
        self.rows = later
        return False
