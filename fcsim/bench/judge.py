"""FCLIB files as they are measured, and a judge of reactions that shares no code with the solvers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib
from fcsim.problem import GlobalProblem, LocalProblem


def project_on_cones(x: FloatArray, mu: FloatArray) -> FloatArray:
    """Projection of x (nc, d) on the cones ||x_T|| <= mu x_N, by its three cases."""
    normal, tangent = x[:, 0], np.linalg.norm(x[:, 1:], axis=1)
    inside, polar = tangent <= mu * normal, mu * tangent <= -normal
    projected = (mu * tangent + normal) / (1 + mu**2)
    direction = x[:, 1:] / np.where(tangent > 0, tangent, 1)[:, None]
    edge = np.column_stack([projected, (mu * projected)[:, None] * direction])
    return np.where(inside[:, None], x, np.where(polar[:, None], 0.0, edge))


@dataclass(frozen=True)
class FclibProblem:
    """A problem of the collection and the independent error of reactions on it."""

    name: str
    form: str
    problem: GlobalProblem | LocalProblem

    @property
    def description(self) -> dict[str, Any]:
        problem = self.problem
        n = problem.n if isinstance(problem, GlobalProblem) else problem.m
        return {"problem": self.name, "form": self.form, "dimension": problem.dimension, "nc": problem.nc, "n": n}

    @cached_property
    def _factor(self) -> Any:
        """LU of M, or of [[M, -G], [-G^T, 0]]; of R for a local problem with equality constraints."""
        p = self.problem
        if isinstance(p, LocalProblem):
            return None if p.R is None else splu(sp.csc_array(p.R))
        M = sp.csc_array(p.M)
        return splu(M if p.G is None else sp.csc_array(sp.block_array([[M, -sp.csc_array(p.G)], [-sp.csc_array(p.G).T, None]])))

    def velocity(self, r: FloatArray) -> FloatArray:
        """u (m,) from r (m,): the equations of motion solved as the file gives them."""
        p = self.problem
        if isinstance(p, LocalProblem):
            u = p.W @ r + p.q
            return u if p.V is None or p.s is None else u - p.V @ self._factor.solve(p.V.T @ r + p.s)
        rhs = p.H @ r + p.f
        x = self._factor.solve(rhs if p.b is None else np.concatenate([rhs, p.b]))
        return p.H.T @ x[: p.n] + p.w

    @cached_property
    def scale(self) -> float:
        """||q||, q the velocity without reactions."""
        return float(np.linalg.norm(self.velocity(np.zeros(self.problem.m))))

    def error(self, r: Any) -> float:
        """||r - P_K(r - (u + g(u)))|| / ||q||, inf where r is not finite."""
        r = np.asarray(r, dtype=np.float64)
        mu, d = self.problem.mu, self.problem.dimension
        if not np.all(np.isfinite(r)):
            return float("inf")
        u = self.velocity(r).reshape(-1, d)
        u[:, 0] += mu * np.linalg.norm(u[:, 1:], axis=1)
        cones = r.reshape(-1, d)
        residual = float(np.linalg.norm(cones - project_on_cones(cones - u, mu)))
        if residual == 0:
            return 0.0
        return residual / self.scale if self.scale > 0 else float("inf")


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
        raise InputError(f"{path}: a rolling friction problem (spacedim 5); it can be read and described, not solved")
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
