"""A masonry problem: blocks, friction, loads with and without the multiplier."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, is_number, is_vector
from fcsim.assembly.time_functions import AccelerationRecord
from fcsim.brief import shown
from fcsim.errors import InputError, expect
from fcsim.mesh.solids.closed_surface import ClosedSurface
from fcsim.mesh.solids.mesh_skin import Cells

GRAVITY = 9.81
"""[m/s^2]"""
DENSITY = 2000.0
"""[kg/m^3] of blocks that do not say theirs."""
SAME_MASS = 0.01
"""By how much a mass and a density times a volume may differ: both are rounded where they are written down."""


@dataclass(frozen=True, eq=False)
class Block:
    """A block of masonry: its closed surface [m], its density [kg/m^3] or its mass [kg], and whether it is held in all its motions.

    InputError where both are said and differ by more than `SAME_MASS`: rigid blocks would have the one, deformable ones the other.
    cells: of which it is made where it deforms; None: it is meshed then.
    """

    surface: ClosedSurface
    density: float | None = None
    mass: float | None = None
    support: bool = False
    cells: Cells | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.surface, ClosedSurface):
            raise InputError(f"Block: expected a closed surface (fcsim.mesh.solids), got {shown(self.surface)}")
        for name in ("density", "mass"):
            value = getattr(self, name)
            if value is not None and not (is_number(value) and value > 0):
                raise InputError(f"block {self.name!r}, {name}: expected a number > 0, or None, got {shown(value)}")
        if self.density is not None and self.mass is not None:
            expect_mass(self.surface, self.density, self.mass, f"block {self.name!r}")

    @property
    def name(self) -> str:
        return self.surface.name


def expect_mass(surface: ClosedSurface, density: float, mass: float, where: str) -> None:
    """InputError unless the mass [kg] is that of the density [kg/m^3] within the surface, to `SAME_MASS`."""
    volume = float(surface.moments()[0])
    if not abs(density * volume - mass) <= SAME_MASS * abs(mass):
        other = f"{density:g} kg/m^3, with which its {volume:.4g} m^3 have {density * volume:.4g} kg"
        raise InputError(f"{where}: expected a mass or a density, or both that agree, got {mass:g} kg and {other}")


@dataclass(frozen=True)
class Acceleration:
    """A body force of all blocks that are free: value (3,) [m/s^2] times their mass, times the multiplier where `scaled`."""

    value: tuple[float, float, float]
    scaled: bool = False


@dataclass(frozen=True)
class PointForce:
    """A force (3,) [N] on a block at a point (3,) [m] (None: its centroid) and a moment (3,) [N m], times the multiplier where `scaled`."""

    block: str
    value: tuple[float, float, float]
    point: tuple[float, float, float] | None = None
    scaled: bool = False
    moment: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class BaseAcceleration:
    """Acceleration of the ground along a direction (3,), of any length: record(t) [m/s^2] times its unit vector."""

    direction: tuple[float, float, float]
    record: AccelerationRecord

    def __call__(self, t: float, over: float = 0.0) -> FloatArray:
        """(3,) [m/s^2] at t, or of a record its mean over the time from t - over / 2, not before 0, to t + over / 2: the steps of a
        simulation add up to the ground's velocity then, however short its pulses are."""
        way = np.asarray(self.direction) / float(np.linalg.norm(self.direction))
        begin, end = max(t - 0.5 * over, 0.0), t + 0.5 * over
        if not (isinstance(self.record, AccelerationRecord) and end > begin):
            return self.record(t) * way
        return (self.record.velocity(end) - self.record.velocity(begin)) / (end - begin) * way


@dataclass(frozen=True)
class Expected:
    """A number that the problem is held against: value, as a number or in words, of a quantity; tolerance relative."""

    quantity: str
    value: float | str
    kind: str = ""
    bound: str = ""
    tolerance: float | None = None


@dataclass(frozen=True, eq=False)
class MasonryProblem:
    """Blocks that stand on each other by Coulomb friction, without tension.

    dimension 2: a wall in the plane of x and z, its blocks prisms along y; z is up; 3: any shapes
    mu, between: friction, of all pairs but those of `between` ((name, name): mu)
    loads: those that stay and, `scaled`, those that grow with the load multiplier
    motion: [m/s] velocities (3,) of supports that move
    shaking: of the ground, in whose axes blocks are seen; of simulations alone
    """

    name: str
    dimension: Literal[2, 3]
    blocks: tuple[Block, ...]
    mu: float
    loads: tuple[Acceleration | PointForce, ...] = (Acceleration((0.0, 0.0, -GRAVITY)),)
    between: Mapping[tuple[str, str], float] = field(default_factory=dict)
    motion: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    shaking: tuple[BaseAcceleration, ...] = ()
    title: str = ""
    question: str = ""
    expected: tuple[Expected, ...] = ()
    source: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        what = f"masonry problem {self.name!r}"
        for kinds, given in ((Block, self.blocks), ((Acceleration, PointForce), self.loads), (BaseAcceleration, self.shaking)):
            if not isinstance(given, tuple | list) or not all(isinstance(each, kinds) for each in given):
                raise InputError(f"{what}: expected a tuple of blocks, of loads and of base accelerations, got {shown(given)}")
        names = [block.name for block in self.blocks]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"{what}: expected different names of blocks, got {', '.join(map(repr, twice))} more than once")
        if all(block.support for block in self.blocks):
            raise InputError(f"{what}: expected blocks that are free, got {len(names)} blocks, all of them supports")
        if self.dimension not in (2, 3):
            raise InputError(f"{what}, dimension: expected 2 or 3, got {self.dimension!r}")
        for mu in (self.mu, *self.between.values()):
            if not (is_number(mu) and mu >= 0):
                raise InputError(f"{what}, mu: expected a friction coefficient >= 0, got {shown(mu)}")
        named = [*(n for pair in self.between for n in pair), *(f.block for f in self.loads if isinstance(f, PointForce)), *self.motion]
        for name in named:
            if name not in names:
                raise InputError(f"{what}: expected the name of a block, got {name!r}")
        self._check_loads(what)
        self._check_shaking(what)
        for name in self.motion:
            if not self.blocks[names.index(name)].support:
                raise InputError(f"{what}, support_motion: expected a support, got the free block {name!r}")

    def _check_loads(self, what: str) -> None:
        for load in self.loads:
            for vector in (load.value, getattr(load, "point", None), getattr(load, "moment", None)):
                if vector is not None and not is_vector(vector, 3):
                    raise InputError(f"{what}, load: expected three finite numbers, got {shown(vector)}")
            x, y, z = load.moment if isinstance(load, PointForce) else (0.0, 0.0, 0.0)
            if self.dimension == 2 and (x or z):
                raise InputError(f"{what}, load: expected a moment about y alone in a plane problem, got {(x, y, z)}")
            if self.dimension == 2 and load.value[1] != 0:
                raise InputError(f"{what}, load: expected no component along y in a plane problem, got {load.value}")

    def _check_shaking(self, what: str) -> None:
        for shake in self.shaking:
            way = shake.direction
            if not (is_vector(way, 3) and 0 < np.linalg.norm(way) < np.inf) or (self.dimension == 2 and way[1] != 0):
                raise InputError(f"{what}, base_acceleration: expected a direction, in a plane problem in x and z, got {shown(way)}")
            if not callable(shake.record):
                raise InputError(f"{what}, base_acceleration: expected an acceleration record, got {shown(shake.record)}")
            if isinstance(shake.record, AccelerationRecord) and shake.record.times[0] < 0:
                raise InputError(
                    f"{what}, base_acceleration: expected times >= 0, since simulations begin at t = 0, got {shake.record.times[0]:g} s: "
                    "shift them (AccelerationRecord.delayed)"
                )

    @cached_property
    def number(self) -> dict[str, int]:
        return {block.name: k for k, block in enumerate(self.blocks)}

    @property
    def friction(self) -> float | dict[tuple[str, str], float]:
        """mu as detection takes it: a number, or a table by pairs."""
        return {("*", "*"): self.mu, **self.between} if self.between else self.mu

    @property
    def scaled(self) -> bool:
        """Whether a load grows with the multiplier."""
        return any(load.scaled for load in self.loads)

    @cached_property
    def size(self) -> float:
        """Largest extent of the free blocks [m]."""
        points = np.concatenate([block.surface.points for block in self.blocks if not block.support])
        return float(np.ptp(points, axis=0).max())

    @cached_property
    def smallest(self) -> float:
        """Smallest of the free blocks' largest extents [m]."""
        return self.smallest_block[1]

    @cached_property
    def smallest_block(self) -> tuple[str, float]:
        """The free block whose largest extent is the smallest, by its name, and that extent [m]."""
        extents = ((block.name, float(np.ptp(block.surface.points, axis=0).max())) for block in self.blocks if not block.support)
        return min(extents, key=lambda each: each[1])

    def ground(self, t: float, over: float = 0.0) -> FloatArray:
        """Acceleration (3,) [m/s^2] of the ground, of records the mean over a time [s], see `BaseAcceleration`."""
        return np.sum([shake(t, over) for shake in self.shaking], axis=0) if self.shaking else np.zeros(3)

    def acceleration(self, *, scaled: bool) -> FloatArray:
        """Sum (3,) [m/s^2] of the body forces that the multiplier scales, or of the others."""
        chosen = [load.value for load in self.loads if isinstance(load, Acceleration) and load.scaled == scaled]
        return np.sum(chosen, axis=0) if chosen else np.zeros(3)


def expect_problem(problem: object, what: str) -> None:
    """InputError where a function of masonry is given something else, the path of a file above all."""
    expect(problem, MasonryProblem, f"{what}, problem", "a MasonryProblem, as read_masonry(path) gives")
