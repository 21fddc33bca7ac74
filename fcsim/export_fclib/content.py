"""What an FCLIB file holds: the problem in one of three forms, a solution, guesses, and what is said about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from fcsim.arrays import FloatArray
from fcsim.brief import brief
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.problem import GlobalForm
from fcsim.problem.rolling import GlobalRollingProblem

Problem = GlobalProblem | LocalProblem | GlobalRollingProblem
Storage = Literal["csc", "csr", "triplet"]


@dataclass(frozen=True)
class Form:
    """One form of the problem: its group is `/fclib_<name>`.

    A matrix is given with the two vectors that are as long as its columns and its rows. The optional matrices and the optional vector
    (equality constraints) are there all or none.
    """

    problem: type[Problem]
    spacedim: tuple[int, ...]
    matrices: Mapping[str, tuple[str, str]]
    vectors: tuple[str, ...]
    optional_matrices: Mapping[str, tuple[str, str]]
    optional_vector: str


GLOBAL = {"M": ("f", "f"), "H": ("f", "w")}
FORMS: Mapping[str, Form] = {
    "global": Form(GlobalProblem, (2, 3), GLOBAL, ("f", "w", "mu"), {"G": ("f", "b")}, "b"),
    "local": Form(LocalProblem, (2, 3), {"W": ("q", "q")}, ("q", "mu"), {"V": ("q", "s"), "R": ("s", "s")}, "s"),
    "global_rolling": Form(GlobalRollingProblem, (5,), GLOBAL, ("f", "w", "mu", "mu_r"), {"G": ("f", "b")}, "b"),
}


@dataclass(frozen=True, eq=False)
class Solution:
    """A solution or a guess: u (m,), r (m,), v (n,) of a global form, l (p,) where there are equality constraints.

    Dynamics: v, u velocities [m/s] and r, l impulses [N s]. Quasi-statics: displacement increments [m] and forces [N].
    """

    u: FloatArray
    r: FloatArray
    v: FloatArray | None = None
    l: FloatArray | None = None

    __repr__ = brief


@dataclass(frozen=True)
class Info:
    """Title, description and mathematical properties of the problem; empty where the file says nothing."""

    title: str = ""
    description: str = ""
    math_info: str = ""


@dataclass(frozen=True)
class MatrixInfo:
    """How a matrix is stored and what the file says about it (None = nothing). `nnz` counts stored entries, explicit zeros too."""

    shape: tuple[int, int]
    nnz: int
    storage: Storage
    nzmax: int
    comment: str | None = None
    conditioning: float | None = None
    determinant: float | None = None
    rank: int | None = None


@dataclass(frozen=True, eq=False)
class FclibFile:
    """The content of one file; `form` is a key of FORMS, `matrices` tells of each matrix by its letter."""

    path: Path
    form: str
    problem: Problem
    info: Info = field(default_factory=Info)
    matrices: Mapping[str, MatrixInfo] = field(default_factory=dict)
    solution: Solution | None = None
    guesses: tuple[Solution, ...] = ()

    __repr__ = brief


def solution_sizes(problem: GlobalForm | LocalProblem) -> dict[str, int]:
    """Return the length of each vector that a solution of `problem` consists of."""
    sizes = {"u": problem.m, "r": problem.m}
    multiplier = problem.s if isinstance(problem, LocalProblem) else problem.b
    if not isinstance(problem, LocalProblem):
        sizes["v"] = problem.n
    if multiplier is not None:
        sizes["l"] = len(multiplier)
    return sizes
