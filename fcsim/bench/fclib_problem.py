"""FCLIB files as they are measured, each with the judge of reactions on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib
from fcsim.problem import GlobalProblem, Judge, LocalProblem


@dataclass(frozen=True)
class FclibProblem:
    """A problem of the collection and the independent error of reactions on it."""

    name: str
    form: str
    problem: GlobalProblem | LocalProblem

    @property
    def description(self) -> dict[str, str | int]:
        problem = self.problem
        n = problem.n if isinstance(problem, GlobalProblem) else problem.m
        return {"problem": self.name, "form": self.form, "dimension": problem.dimension, "nc": problem.nc, "n": n}

    @cached_property
    def judge(self) -> Judge:
        """SingularMatrix where M or R is singular."""
        return Judge(self.problem)

    @property
    def scale(self) -> float:
        """||q||, q the velocity without reactions."""
        return self.judge.scale

    def error(self, r: FloatArray) -> float:
        """The published error, which tables compare: ||r - P_K(r - (u + g(u)))|| / ||q||, inf where r is not finite."""
        return self.judge.error(r)


def fclib_files(paths: Sequence[Path]) -> list[Path]:
    """The files given, and those of the folders given."""
    files: list[Path] = []
    for path in paths:
        found = sorted(path.glob("*.hdf5")) if path.is_dir() else [path]
        if not found:
            raise InputError(f"{path}: expected FCLIB files (*.hdf5), the folder holds none")
        files += found
    return files


def read_problem(path: Path) -> FclibProblem:
    """The problem of a file. Raises InputError where it cannot be read or is a rolling friction problem."""
    content = read_fclib(path)
    if not isinstance(content.problem, GlobalProblem | LocalProblem):
        raise InputError(f"{path}: a rolling friction problem (spacedim 5), which benchmarks leave out; fcsim solve solves it")
    return FclibProblem(path.stem, content.form, content.problem)


def read_problems(paths: Sequence[Path]) -> tuple[list[FclibProblem], list[str]]:
    """The problems that can be solved, the small ones first, and a note for each file left out (rolling friction)."""
    problems, notes = [], []
    for path in fclib_files(paths):
        content = read_fclib(path)
        if isinstance(content.problem, GlobalProblem | LocalProblem):
            problems.append(FclibProblem(path.stem, content.form, content.problem))
        else:
            notes.append(f"{path.stem}: left out, a rolling friction problem (spacedim 5)")
    return sorted(problems, key=lambda p: (p.problem.nc, p.name)), notes
