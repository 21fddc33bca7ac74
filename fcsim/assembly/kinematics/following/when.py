"""When of a step its loads are taken."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class When:
    """The loads of a step: share f(end) + (1 - share) f(begin) of a factor f of time; times in s."""

    begin: float
    end: float
    share: float = 1.0

    @staticmethod
    def at(t: float) -> When:
        return When(t, t)
