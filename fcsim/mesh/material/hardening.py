"""Isotropic hardening: the yield stress by the equivalent plastic strain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, is_number, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError


class Hardening(Protocol):
    """Yield stress [Pa] and its slope [Pa] at equivalent plastic strains (n,)."""

    def stress(self, strain: FloatArray) -> FloatArray: ...

    def slope(self, strain: FloatArray) -> FloatArray: ...


@dataclass(frozen=True)
class LinearHardening:
    """initial + modulus e [Pa]; from a tangent modulus E_t of the bar: modulus = E E_t / (E - E_t)."""

    initial: float
    modulus: float = 0.0

    def __post_init__(self) -> None:
        if not (is_number(self.initial) and self.initial > 0):
            raise InputError(f"LinearHardening: expected an initial yield stress > 0 in Pa, got {shown(self.initial)}")
        if not is_number(self.modulus):
            raise InputError(f"LinearHardening: expected a finite modulus in Pa, got {shown(self.modulus)}")

    def stress(self, strain: FloatArray) -> FloatArray:
        return np.maximum(self.initial + self.modulus * strain, 1e-6 * self.initial)  # softening ends at nearly nothing

    def slope(self, strain: FloatArray) -> FloatArray:
        return np.where(self.initial + self.modulus * strain > 1e-6 * self.initial, self.modulus, 0.0)


@dataclass(frozen=True)
class HardeningTable:
    """Straight lines between the points of a table: plastic strains, ascending from 0, and yield stresses > 0 [Pa]; constant beyond."""

    strain: tuple[float, ...]
    yield_stress: tuple[float, ...]

    def __post_init__(self) -> None:
        e, s = numbers_of(self.strain), numbers_of(self.yield_stress)
        if e.ndim != 1 or e.shape != s.shape or not len(e) or e[0] != 0 or np.any(np.diff(e) <= 0) or not np.all(s > 0):
            raise InputError(
                "HardeningTable: expected as many plastic strains, ascending from 0, as yield stresses > 0 in Pa, got "
                f"{shown(self.strain)} and {shown(self.yield_stress)}"
            )

    def stress(self, strain: FloatArray) -> FloatArray:
        return np.asarray(np.interp(strain, self.strain, self.yield_stress))

    def slope(self, strain: FloatArray) -> FloatArray:
        slopes = np.append(np.diff(self.yield_stress) / np.diff(self.strain), 0.0)
        return np.asarray(slopes[np.maximum(np.searchsorted(self.strain, strain, side="right") - 1, 0)])


@dataclass(frozen=True)
class HardeningFunction:
    """`function(e)` [Pa] of plastic strains (n,), NumPy, and its derivative; without one, by central differences."""

    function: Callable[[FloatArray], FloatArray]
    derivative: Callable[[FloatArray], FloatArray] | None = None

    def __post_init__(self) -> None:
        at = np.array([0.0, 0.01])
        try:
            value = np.asarray(self.function(at), dtype=float)
        except Exception as error:  # whatever a user's function raises
            raise InputError(
                f"HardeningFunction: expected a function of an array of plastic strains, got {type(error).__name__}: {error}"
            ) from None
        if value.shape != at.shape or not np.all(value > 0):
            raise InputError(f"HardeningFunction: expected yield stresses > 0 in Pa at plastic strains 0 and 0.01, got {value}")

    def stress(self, strain: FloatArray) -> FloatArray:
        return np.asarray(self.function(strain), dtype=float)

    def slope(self, strain: FloatArray) -> FloatArray:
        if self.derivative is not None:
            return np.asarray(self.derivative(strain), dtype=float)
        step = 1e-6
        low = np.maximum(strain - step, 0.0)
        return (self.stress(strain + step) - self.stress(low)) / (strain + step - low)


def as_hardening(value: Hardening | float) -> Hardening:
    """A number is a yield stress that stays."""
    return LinearHardening(float(value)) if is_number(value) else cast(Hardening, value)


def plastic_flow(excess: FloatArray, stiffness: float, hardening: Hardening, strain: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the increments e (n,) >= 0 with excess - stiffness e = hardening.stress(strain + e), zero where excess is within it, and
    which flow (n,). excess: the equivalent trial stress (n,); stiffness [Pa]: its fall by e; nan where there is no such increment.

    Newton's method between bounds that bisection moves: safe for hardening of any shape that falls less steeply than stiffness e.
    """
    yields = excess - hardening.stress(strain)
    flows = yields > 1e-12 * np.abs(excess)
    low, high = np.zeros_like(excess), np.where(flows, excess / stiffness, 0.0)
    e = np.where(flows, yields / (stiffness + np.maximum(hardening.slope(strain), 0.0)), 0.0)
    for _ in range(100):
        f = np.where(flows, excess - stiffness * e - hardening.stress(strain + e), 0.0)
        if np.all(np.abs(f) <= 1e-14 * np.abs(excess)):
            break
        low, high = np.where(f > 0, e, low), np.where(f > 0, high, e)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = e + f / (stiffness + hardening.slope(strain + e))
        inside = (newton >= low) & (newton <= high)
        e = np.where(f == 0, e, np.where(inside, newton, 0.5 * (low + high)))
    failed = flows & (np.abs(excess - stiffness * e - hardening.stress(strain + e)) > 1e-8 * np.abs(excess))
    return np.where(failed, np.nan, e), flows
