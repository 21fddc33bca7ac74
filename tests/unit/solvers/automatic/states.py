"""A race's state written down, as the rules of `auto` take it: prices in sweeps (1 each), what was spent, what contacts hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sp

INF = float("inf")
ENDED = object()
"""The result of a method that has ended."""
NEAR, AFAR = 1e-4, 1e-2
"""Errors below and above `FAR`."""
LOOSE, EDGES_HELD, FACES_HELD = 0.5, 1.1, 1.4
"""Velocities held over those of the bodies."""


@dataclass
class Shown:
    """What a rule sees of a method in the race."""

    iterations: int = 0
    spent: float = 0.0
    fell: float = 10.0
    slows: float = 1.0
    slowed_by: float = 0.0
    needed: float = INF
    tenfolds: float = 0.0
    best: float = 1.0
    result: object = None
    paths: list[list[float]] = field(default_factory=list)

    @property
    def monitor(self) -> Any:
        return SimpleNamespace(iterations=self.iterations, best=self.best, paths=self.paths)

    def gain(self, share: float) -> float:
        return self.fell

    def rest(self, share: float) -> float:
        return self.slows

    def slowed(self) -> float:
        return self.slowed_by

    def needs(self) -> float:
        return self.needed

    def decades(self) -> float:
        return self.tenfolds


@dataclass
class State:
    """A race of ten contacts: prices are 1 a sweep, 10 an iteration of Newton or proximal Newton, 15 of an interior
    point, 100 ADMM's factor and 2 an iteration."""

    best: float = AFAR
    tol: float = 1e-8
    holds: float = LOOSE
    dimension: int = 3
    warm: bool = False
    joints: object = None
    in_velocities: bool = True
    nc: int = 10
    without: tuple[str, ...] = ()
    splitting: int = 30
    patience: int = 12
    newton_price: float = 10.0
    elimination: float = 0.0
    sparse: bool = False
    points: float = 4.0
    regular: bool = False
    keeps: bool = False
    shares: object = None
    single: bool | None = None
    small: bool = False
    still: bool = False
    passed: bool = False
    motion: object = None
    compliance: np.ndarray = field(default_factory=lambda: np.ones(2))
    runners: dict[str, Shown] = field(default_factory=dict)

    @property
    def options(self) -> Any:
        return SimpleNamespace(without=self.without, splitting=self.splitting, patience=self.patience, probe=20, max_iterations=1000)

    @property
    def problem(self) -> Any:
        W = sp.csr_array(np.eye(1)) if self.sparse else np.eye(1)
        delassus = SimpleNamespace(shares=self.shares, size=self.nc * self.dimension, motion=self.motion)
        sizes = {"nc": self.nc, "dimension": self.dimension, "m": self.nc * self.dimension}
        return SimpleNamespace(W=W, delassus=delassus, compliance=self.compliance, **sizes)

    @property
    def prices(self) -> Any:
        return SimpleNamespace(
            **{
                "in_velocities": self.in_velocities,
                "sweep": 1.0,
                "piece": 4.0,
                "interior": 15.0,
                "proof": 50.0,
                "admm": 2.0,
                "least_in_velocities": 10.0,
            },
            **dict.fromkeys(("least", "proximal", "running"), lambda held: self.newton_price),
            newton=lambda held: self.newton_price + self.elimination,
            **dict.fromkeys(("splitting", "least_splitting"), lambda iterations: 100.0 + 2.0 * iterations),
            least_squares=lambda held: 25.0,
        )

    @property
    def monitor(self) -> Any:
        return SimpleNamespace(tol=self.tol, memory=object() if self.keeps else None)

    @property
    def start(self) -> np.ndarray:
        return np.ones(self.nc * self.dimension)

    def best_r(self) -> np.ndarray:
        return np.ones(self.nc * self.dimension)

    def spent(self) -> float:
        return sum(runner.spent for runner in self.runners.values())

    def running(self) -> list[Shown]:
        return [runner for runner in self.runners.values() if runner.result is None]

    def over(self, name: str) -> bool:
        return name in self.without or (name in self.runners and self.runners[name].result is not None)


def state(*, runners: dict[str, Shown] | None = None, **changes: Any) -> Any:
    """A race in that state, as rules take it."""
    return State(runners=runners or {}, **changes)


def newton(**changes: Any) -> Shown:
    """Proximal Newton after 70 iterations that cost 700, of which half brought the error down tenfold, to near a solution."""
    return Shown(**{"iterations": 70, "spent": 700.0, "best": NEAR, **changes})


STILL = Shown(iterations=200, spent=200.0, fell=1.1)
"""Sweeps that stand still."""
