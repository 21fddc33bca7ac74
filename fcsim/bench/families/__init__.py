"""Families of synthetic problems with seeds: assemblies of rigid bodies, each problem one time step of theirs, by name, size and seed.

    problem = problems("spheres", 1000, 7)      # a bed of balls with about 1000 contacts, always the same one

NumPy and SciPy alone; the same arguments give the same problem on every machine, up to the last digits of its arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fcsim.bench.families import blocks, disturbed, grains
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem, LocalProblem

LARGEST = 200_000
"""Contacts up to which problems are made."""


@dataclass(frozen=True)
class Family:
    """make(size, random) -> problem with about `size` contacts; solvable: whether each of its problems has a solution, None: not known."""

    make: Callable[[int, np.random.Generator], GlobalProblem | LocalProblem]
    dimension: int
    solvable: bool | None = True

    @property
    def about(self) -> str:
        """The first sentence of what the family is."""
        return " ".join((self.make.__doc__ or "").split("\n\n")[0].split())


FAMILIES: dict[str, Family] = {
    "spheres": Family(grains.spheres, 3),
    "disks": Family(grains.disks, 2),
    "rocks": Family(grains.rocks, 3),
    "mass-ratios": Family(grains.mass_ratios, 3),
    "frictions": Family(grains.frictions, 3),
    "boxes": Family(blocks.boxes, 3),
    "walls": Family(blocks.walls, 3),
    "walls-2D": Family(blocks.walls_2d, 2),
    "towers": Family(blocks.towers, 3),
    "arches": Family(blocks.arches, 2),
    "near-singular": Family(disturbed.near_singular, 3),
    "noise": Family(disturbed.noise, 3, None),
    "squeezed": Family(disturbed.squeezed, 3, False),
    "wedged": Family(disturbed.wedged, 3, False),
    "rods": Family(disturbed.rods, 2, False),
}


def problems(family: str, size: int, seed: int) -> GlobalProblem | LocalProblem:
    """Return the problem of that family with about `size` contacts; the seed draws its geometry, masses, friction and tilt.

    Raises InputError for an unknown family, a size outside 1 to `LARGEST`, a negative seed.
    """
    refuse_unknown([family], [size], [seed])
    # the name takes part, so that families of one seed do not share their random numbers
    return FAMILIES[family].make(size, np.random.default_rng([seed, size, *family.encode()]))


def refuse_unknown(families: Sequence[str], sizes: Sequence[int], seeds: Sequence[int]) -> None:
    """Raise InputError for what `problems` has no problem of."""
    for family in families:
        if family not in FAMILIES:
            raise InputError(f"family {family!r}: expected one of {', '.join(FAMILIES)}")
    if wrong := [size for size in sizes if not 1 <= size <= LARGEST]:
        raise InputError(f"size: expected a number of contacts from 1 to {LARGEST}, got {wrong[0]}")
    if wrong := [seed for seed in seeds if seed < 0]:
        raise InputError(f"seed: expected an integer >= 0, got {wrong[0]}")
