"""Links in a step that is solved again until they are closed where the next step begins."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.timestep.links.linked import Linked
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State
from fcsim.timestep.step import Attempt

CLOSED = 1e-10
"""Of the model's size: how far a link may be from closed at the end of a step."""

TURNED = 1e-11
"""Of a unit force: by how much directions of links may differ from one round to the next where deformable bodies are linked; moments of
momentum are off by so much of the link's impulse times the model's size."""

SETTLED, BORNE = 4, 1e-9
"""After so many rounds directions that go on changing by no more than this are those of a solver's tolerance."""

ROUNDS = 12


class Closing:
    """The rows of a step while it is solved again until they are closed; given_up: they are not, and the step is to be cut."""

    def __init__(self, rows: Linked | None, extent: float) -> None:
        """extent [m]: size of the model."""
        self.rows, self._extent, self._rounds, self.given_up = rows, extent, 0, False

    def impulse(self, multiplier: FloatArray | None) -> FloatArray | float:
        """G l (n_dofs,) [N s; quasi-statics: N]."""
        return 0.0 if self.rows is None or multiplier is None else np.asarray(self.rows.G @ multiplier)

    def keep(self, model: Model, scheme: Scheme, v: FloatArray, ends: tuple[State, State], attempts: list[Attempt], share: float) -> bool:
        """Whether the links are closed after the step's answer v (n_dofs,), from the one of `ends` to the other, and their forces act where
        they are meant to; where not, `rows` are those of its next solve.

        InputError where the answer does not keep the rows as they are: links that contradict each other or the supports.
        """
        if self.rows is None:
            return True
        self.rows.refuse_contradictions(v, scheme.timing.length_per_u, self._extent)
        missing = self.rows.missing(model, scheme, v, ends[1])
        worst = float(np.abs(missing).max(initial=0.0)) / self._extent
        if worst <= CLOSED and not scheme.timing.moving:
            return True
        later = self.rows.bent(model, scheme, v, ends, missing)
        change = self.rows.change(later, model, scheme, self._extent)
        if worst <= CLOSED and change <= (TURNED if self._rounds < SETTLED else BORNE):
            return True
        self._rounds += 1
        if self._rounds > ROUNDS:
            self.given_up = True
            attempts.append(Attempt("links", "the free motion", "did not close", max(worst, change), ROUNDS, share, CLOSED))
            return False
        self.rows = later
        return False
