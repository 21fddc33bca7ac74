"""What the atlas asks: problems of a folder of files, and those that are built by rule, each beside the number that it is held against."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.integrate import quad

from fcsim.errors import InputError
from fcsim.masonry.atlas.shapes import arch, dome, one_block, stack, wall
from fcsim.masonry.json_file import read_masonry
from fcsim.masonry.problem import GRAVITY, Block, MasonryProblem
from fcsim.masonry.pushes import pushed, tilted

X = (1.0, 0.0, 0.0)
FERRIS_TIN_LOI = "M. C. Ferris and F. Tin-Loi, Int. J. Mech. Sci. 43 (2001)"


@dataclass(frozen=True, eq=False)
class Entry:
    """A problem of the atlas: its name, the number that is published or follows in closed form (None: none), and whose it is.

    coulomb: the number under Coulomb's law where it differs from `number`, an associative one
    """

    name: str
    number: float | None
    source: str
    coulomb: float | None = None


@dataclass(frozen=True, eq=False)
class Collapse(Entry):
    """How much of its growing load a structure bears; where none grows, whether it stands."""

    problem: MasonryProblem | None = None
    quantity: str = "load multiplier"

    @property
    def asked(self) -> MasonryProblem:
        assert self.problem is not None
        return self.problem


@dataclass(frozen=True, eq=False)
class Thickness(Entry):
    """The least thickness, between `low` and `high`, at which what is built of it stands under its weight."""

    build: Callable[[float], MasonryProblem] = dome
    low: float = 0.0
    high: float = 1.0
    quantity: str = "least thickness over radius"


@dataclass(frozen=True, eq=False)
class Rocking(Entry):
    """The quarter period [s] of one block that begins turned about its toe by a share of the angle at which it would stand on it."""

    half_width: float = 0.2
    half_height: float = 0.6
    share: float = 0.4
    quantity: str = "quarter period [s]"


@dataclass(frozen=True, eq=False)
class Descent(Entry):
    """The multiplier of one block pushed by displacement when it has turned by half the angle at which it falls by itself."""

    width: float = 0.4
    height: float = 1.2
    quantity: str = "multiplier at half the turn"


def of_folder(folder: Path) -> tuple[tuple[Collapse, ...], tuple[tuple[str, str], ...]]:
    """The problems of a folder's files, and (file, reason) of what cannot be asked; InputError where it holds no JSON."""
    files = sorted(folder.glob("*.json"))
    if not files:
        raise InputError(f"{folder}: expected a folder of masonry problems in JSON, found none")
    entries, left = [], []
    for path in files:
        try:
            entries.append(_of_file(path))
        except InputError as error:
            left.append((path.name, str(error)))
    return tuple(entries), tuple(left)


def _of_file(path: Path) -> Collapse:
    problem = read_masonry(path)
    if problem.shaking or problem.motion:
        raise InputError(f"{path}: expected loads that stay or grow, got ground or supports that move: `fcsim shake`, `fcsim settle`")
    numbers = [e for e in problem.expected if not isinstance(e.value, str) and e.quantity.startswith("load multiplier")]
    upper = [e for e in numbers if "coulomb" not in e.quantity.lower()]
    lower = [e for e in numbers if "coulomb" in e.quantity.lower()]
    first = next(iter(upper or lower), None)
    said = next((text.split(":")[0].split("(http")[0].strip() for text in problem.source), path.name)
    kinds = f"{first.kind.split(',')[0].split(';')[0]}; " if first is not None and first.kind else ""
    return Collapse(
        path.stem,
        None if first is None else float(first.value),
        f"{kinds}{said}",
        float(lower[0].value) if lower and upper else None,
        replace(problem, name=path.stem),
    )


def built() -> tuple[Entry, ...]:
    """The problems that are built by rule."""
    ratio = 0.4 / 1.2
    courses = ((0.5, 1, 1, 1, 1, 0.5), (1,) * 5)
    rule = "closed form: a block falls at the lesser of its proportion and mu"
    ftl = pushed(wall([courses[k % 2] for k in range(6)], (0.4, 0.175), 0.65), X)
    table = tilted(wall([courses[k % 2] for k in range(11)], (0.2, 0.1), 0.7), X)
    oppenheim = pushed(arch(7, 1.5, 0.7, embrace=math.radians(157.5), radius=10.0), X)
    return (
        Collapse("block that topples", ratio, rule, problem=pushed(one_block(0.4, 1.2, 0.7), X)),
        Collapse("block that slides", 0.25, rule, problem=pushed(one_block(0.4, 1.2, 0.25), X)),
        Collapse("stack of four, tilted", 0.5, "closed form: b/h of the whole", problem=tilted(stack(4, 0.6, 0.3, 0.8), X)),
        Collapse("wall 1 by rule", 0.642859, FERRIS_TIN_LOI, 0.63982, problem=ftl),
        Collapse("wall of 11 courses, tilted", None, "no number published: 60 blocks on a table", problem=table),
        Collapse("arch of seven voussoirs by rule", 0.37, "I. J. Oppenheim, Earthq. Eng. Struct. Dyn. 21 (1992)", problem=oppenheim),
        Thickness("semicircle, 40 voussoirs", 0.1075, "M. Milankovitch (1907), continuous", build=_semicircle, low=0.08, high=0.16),
        Thickness("dome of 8 rings", 0.042, "J. Heyman, Int. J. Solids Struct. 3 (1967), lunes", build=dome, low=0.03, high=0.06),
        Rocking("rocking, 0.4 of the angle", _quarter(0.2, 0.6, 0.4), "G. W. Housner (1963): the exact integral", share=0.4),
        Rocking("rocking, 0.8 of the angle", _quarter(0.2, 0.6, 0.8), "G. W. Housner (1963): the exact integral", share=0.8),
        Descent("descending branch of a block", math.tan(0.5 * math.atan(ratio)), "closed form: tan(alpha - theta)"),
    )


def _semicircle(thickness: float) -> MasonryProblem:
    return arch(40, thickness, 0.7)


def _quarter(b: float, h: float, share: float) -> float:
    """int d theta / theta' with (4/3) R theta'' = -g sin(alpha - theta), from rest at `share` alpha down to 0 [s]."""
    alpha, R = math.atan2(b, h), math.hypot(b, h)

    def slowness(s: float) -> float:  # theta = share alpha - s^2 takes the root of the speed away
        energy = math.cos(alpha * (1 - share)) - math.cos(alpha * (1 - share) + s * s)
        return 2 * s / math.sqrt(1.5 * GRAVITY / R * energy) if s else 2 / math.sqrt(1.5 * GRAVITY / R * math.sin(alpha * (1 - share)))

    return float(quad(slowness, 0.0, math.sqrt(share * alpha))[0])


def rocking_problem(entry: Rocking) -> MasonryProblem:
    """The block of an entry turned about its right lower edge."""
    b, h = entry.half_width, entry.half_height
    upright = one_block(2 * b, 2 * h, 5.0)
    floor, block = upright.blocks
    angle = entry.share * math.atan2(b, h)
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    toe = np.array([2 * b, 0.0, 0.0])
    points = (block.surface.points - toe) @ turn.T + toe
    return replace(upright, blocks=(floor, Block(replace(block.surface, points=points), block.density)))
