"""Line searches on the merit function 0.5 ||F||^2 of the nonsmooth Newton methods, monotone or not.

A search is a function of (merit, value, slope, trials, reference): merit(t) along the step, its value and slope at t = 0, and what it must
fall below where that is not the value itself; it returns the step length t. Sources: Goldstein and Price (Numer. Math. 10, 1967), Armijo
(Pacific J. Math. 16, 1966); references of the non-monotone searches: Grippo, Lampariello, Lucidi (SIAM J. Numer. Anal. 23, 1986), Zhang
and Hager (SIAM J. Optim. 14, 2004). Names and constants of Siconos 4.4.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

Merit = Callable[[float], float]

SHORTEST = 1e-16
"""Below this fraction of Newton's step a search gives up."""


def no_line_search(merit: Merit, value: float, slope: float, trials: int = 100, reference: float | None = None) -> float:
    """Full steps (NLS)."""
    return 1.0


def goldstein_price(
    merit: Merit, value: float, slope: float, trials: int = 100, reference: float | None = None, m1: float = 0.01, m2: float = 0.99
) -> float:
    """Goldstein-Price: value + m2 t slope <= merit(t) <= reference + m1 t slope by bracketing and bisection."""
    ceiling = value if reference is None else reference
    low, high, t = 0.0, np.inf, 1.0
    for _ in range(trials):
        trial = merit(t)
        if not trial <= ceiling + m1 * t * slope:  # too long, or not a number
            high = t
        elif trial < value + m2 * t * slope:
            low = t
        else:
            return t
        t = 2 * t if np.isinf(high) else 0.5 * (low + high)
        if t < SHORTEST:
            break
    return low or t


def goldstein(merit: Merit, value: float, slope: float, trials: int = 100, reference: float | None = None) -> float:
    """Goldstein's conditions with the constants 1e-4 and 1 - 1e-4."""
    return goldstein_price(merit, value, slope, trials, reference, 1e-4, 1 - 1e-4)


def armijo(merit: Merit, value: float, slope: float, trials: int = 100, reference: float | None = None, m1: float = 1e-4) -> float:
    """Armijo: halve t until merit(t) <= reference + m1 t slope."""
    ceiling = value if reference is None else reference
    t = 1.0
    for _ in range(trials):
        if merit(t) <= ceiling + m1 * t * slope or t < SHORTEST:
            return t
        t *= 0.5
    return t


LINE_SEARCHES: dict[str, Callable[[Merit, float, float, int, float], float]] = {
    "none": no_line_search,
    "Goldstein-Price": goldstein_price,
    "Goldstein": goldstein,
    "Armijo": armijo,
}


def _zhang_hager(values: deque[float], eta: float = 0.85) -> float:
    weights = eta ** np.arange(len(values) - 1, -1, -1)
    return float(weights @ np.array(values) / weights.sum())


REFERENCES: dict[str, Callable[[deque[float]], float]] = {
    "none": lambda values: values[-1],
    "maximum": max,
    "mean": lambda values: float(np.mean(values)),
    "Zhang-Hager": _zhang_hager,
}
"""What the merit must fall below, from its last values (the current one last)."""
