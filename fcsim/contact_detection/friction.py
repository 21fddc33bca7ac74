"""Friction by pairs of bodies: one number, a table of names, or a function of two names."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from fcsim.arrays import FloatArray, IntArray, is_number
from fcsim.brief import shown
from fcsim.errors import InputError, asked

Friction = float | Mapping[tuple[str, str], float] | Callable[[str, str], float]
"""mu of every pair; {("brick", "floor"): 0.5, ("*", "*"): 0.7}, in either order, "*" being any body, of which the most exact entry counts
(where one for either of two bodies with "*" gives them different numbers, theirs is asked for); or a function of two names."""


class FrictionTable:
    """mu of pairs of bodies, asked for each pair once."""

    def __init__(self, mu: Friction, names: Sequence[str]) -> None:
        self._mu, self._names = mu, tuple(names)
        self._known: dict[tuple[int, int], float] = {}
        if isinstance(mu, Mapping):
            if "*" in self._names:  # its entries would be those of all
                raise InputError("mu: expected no body of the name '*', which stands for any body in a table: give it another one")
            for key in mu:
                if not (isinstance(key, tuple) and len(key) == 2):
                    mend = f": of one body with whatever it touches ({key!r}, '*')" if isinstance(key, str) else ""
                    raise InputError(f"mu: expected pairs of body names as keys, got {key!r}{mend}")
                unknown = [name for name in key if name != "*" and name not in self._names]
                if unknown:
                    raise InputError(f"mu: expected names of bodies, or '*', got {unknown[0]!r}")
                _checked(mu[key], key)
                if (turned := (key[1], key[0])) in mu and mu[turned] != mu[key]:
                    raise InputError(f"mu: expected one number for {key[0]!r} and {key[1]!r}, got {mu[key]!r} and {mu[turned]!r}")
        elif not callable(mu):
            _checked(mu, ("*", "*"))

    def __call__(self, pairs: IntArray) -> FloatArray:
        """mu (nc,) of pairs of body numbers (nc, 2)."""
        if not callable(self._mu) and not isinstance(self._mu, Mapping):
            return np.full(len(pairs), float(self._mu))
        different, place = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
        return np.array([self._of(int(a), int(b)) for a, b in different])[place.ravel()] if len(pairs) else np.empty(0)

    def _of(self, a: int, b: int) -> float:
        if (a, b) not in self._known:
            one, other = self._names[a], self._names[b]
            self._known[a, b] = _checked(self._asked(one, other), (one, other)) if callable(self._mu) else self._entry(one, other)
        return self._known[a, b]

    def _asked(self, one: str, other: str) -> float:
        assert callable(self._mu)
        try:
            takes = inspect.signature(self._mu)
        except (TypeError, ValueError):  # compiled functions may have none
            return asked(f"mu of {one!r} and {other!r}", self._mu, one, other)
        try:
            takes.bind(one, other)
        except TypeError as error:
            raise InputError(f"mu: expected a function of two names of bodies, got one of {takes} ({error})") from None
        return asked(f"mu of {one!r} and {other!r}", self._mu, one, other)

    def _entry(self, one: str, other: str) -> float:
        assert isinstance(self._mu, Mapping)
        for keys in (((one, other), (other, one)), ((one, "*"), ("*", one), (other, "*"), ("*", other)), (("*", "*"),)):
            given = {key: float(self._mu[key]) for key in keys if key in self._mu}
            if len(set(given.values())) > 1:  # which of them is meant no order of the bodies can tell
                both = " and ".join(f"{mu:g} of {key}" for key, mu in given.items())
                pair = f"{one!r} and {other!r}"
                raise InputError(f"mu of {pair}, which touch: expected one number, got {both}; add an entry for {one, other}")
            if given:
                return next(iter(given.values()))
        raise InputError(f"mu: expected an entry for the bodies {one!r} and {other!r}, which touch (or one for ('*', '*')), got none")


def _checked(mu: float, pair: tuple[str, str]) -> float:
    if not (is_number(mu) and mu >= 0):
        raise InputError(f"mu of {pair[0]!r} and {pair[1]!r}: expected a friction coefficient >= 0, got {shown(mu)}")
    return float(mu)
