"""What a user says of contact between all bodies, checked: the alert distance and who does not touch whom."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np

from fcsim.arrays import IntArray, is_number
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.errors import InputError


def refuse_alert(what: str, alert: float | None) -> None:
    """InputError for an alert distance that is none."""
    if alert is not None and not (is_number(alert) and alert > 0):
        raise InputError(f"{what}, alert: expected a distance > 0 in m, got {shown(alert)}")


def excluded_pairs(what: str, model: Model, exclude: Iterable[tuple[str, str]]) -> IntArray:
    """A number for each pair of bodies i <= j, nb i + j, ascending; InputError for what are no pairs of names of bodies."""
    given = [exclude] if isinstance(exclude, str) or not isinstance(exclude, Iterable) else list(exclude)
    if any(not isinstance(pair, Collection) or isinstance(pair, str) or len(pair) != 2 for pair in given):
        raise InputError(f'{what}, exclude: expected pairs of names of bodies, as [("a", "b")], got {shown(exclude)}')
    pairs = [sorted((model.body_number(one), model.body_number(other))) for one, other in given]
    return np.array(sorted(i * len(model.bodies) + j for i, j in pairs), dtype=np.int64)
