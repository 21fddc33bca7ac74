"""How far the solve of a wall's step is from this machine's floor: flops and bytes counted, rates measured.

    python benchmarks/floor.py                 120 steps of cases/masonry_wall
    python benchmarks/floor.py --set divisions=16,8,8 --steps 6

Counted while the wall runs, in the condensed elimination of Newton's system (fcsim/solvers/newton_system.py): the Cholesky factor of the
sticking contacts' block, triangular solves and products for the border, the normal components' elimination and the LU of what is left;
and the bytes of W read by products with it. The floor is those flops at the rates of this machine's LAPACK at like sizes and those bytes
at its memory's rate, one thread. Above it stand gathering of blocks, small arrays and Python.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from rich.console import Console
from rich.table import Table

from fcsim.case import load_case, parse_parameters
from fcsim.solvers import newton_system

CASE = Path(__file__).resolve().parents[1] / "cases" / "masonry_wall"
SIZE = 700
"""Unknowns of the matrices by which rates are measured, about those of the default wall's elimination."""
KINDS = {
    "Cholesky, sticking block": "Cholesky",
    "triangular solves, border": "triangular solve",
    "products, border": "product",
    "normal elimination": "product",
    "LU, what is left": "LU",
}


def rate(work: float, run: Callable[[], Any], repeats: int = 15) -> float:
    """Work a second, the best of a few."""
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - begin)
    return work / best


def rates() -> dict[str, float]:
    """Flops a second of LAPACK and BLAS, bytes a second read by a product with a sparse matrix larger than the caches."""
    n, rng = SIZE, np.random.default_rng(0)
    A = rng.standard_normal((n, n))
    A = np.asfortranarray(A @ A.T + n * np.eye(n))
    L, B = np.linalg.cholesky(A), np.asfortranarray(rng.standard_normal((n, n)))
    S = sp.random_array((20_000, 20_000), density=0.02, rng=rng, format="csr")
    x = np.ones(20_000)
    return {
        "Cholesky": rate(n**3 / 3, lambda: sla.lapack.dpotrf(A, lower=True, clean=False)),
        "triangular solve": rate(n**3, lambda: sla.blas.dtrsm(1.0, L, B, lower=True)),
        "product": rate(2 * n**3, lambda: A @ B),
        "LU": rate(2 * n**3 / 3, lambda: sla.lapack.dgetrf(A)),
        "bytes": rate(12 * S.nnz, lambda: S @ x),
    }


class Count:
    """Flops by kind and bytes of W, counted around the elimination's methods."""

    def __init__(self) -> None:
        self.flops: defaultdict[str, float] = defaultdict(float)
        self.calls: Counter[str] = Counter()
        self.bytes = 0.0

    def install(self) -> None:
        system, normal = newton_system.CondensedSystem, newton_system._NormalElimination
        hold, extend, condensed, made, solve = system._hold, system._extend, system._condensed, normal.__init__, normal.solve

        def counted_hold(this: Any, held: np.ndarray) -> None:
            hold(this, held)
            self._add("Cholesky, sticking block", (this._d * len(held)) ** 3 / 3)

        def counted_extend(this: Any, contacts: np.ndarray) -> None:
            before = this._P.shape[1]
            extend(this, contacts)
            n, k = this._P.shape[0], this._P.shape[1]
            if k > before:
                self._add("triangular solves, border", n**2 * (k - before))
                self._add("products, border", n * (k**2 - before**2))  # half of the symmetric product

        def counted_condensed(this: Any, A: np.ndarray, B: np.ndarray, rhs: np.ndarray) -> np.ndarray:
            self.bytes += 2 * (this._W.nnz * 12 if sp.issparse(this._W) else this._W.nbytes)  # coupling of open contacts, W dr
            self.calls["Newton systems"] += 1
            return condensed(this, A, B, rhs)

        def counted_made(this: Any, response: np.ndarray, *rest: Any) -> None:
            made(this, response, *rest)
            n, c = len(this._S), len(this.closed)
            self._add("normal elimination", c**3 / 3 + 2 * c**2 * n + 2 * c * n**2)

        def counted_solve(this: Any, *given: Any) -> Any:
            self._add("LU, what is left", 2 * len(this._S) ** 3 / 3)
            return solve(this, *given)

        for owner, name, counted in (
            (system, "_hold", counted_hold),
            (system, "_extend", counted_extend),
            (system, "_condensed", counted_condensed),
            (normal, "__init__", counted_made),
            (normal, "solve", counted_solve),
        ):
            setattr(owner, name, counted)

    def _add(self, kind: str, flops: float) -> None:
        self.flops[kind] += flops
        self.calls[kind] += 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments")
    options = parser.parse_args()
    given = {**dict(text.split("=", 1) for text in options.assignments), "steps": str(options.steps)}
    measured = rates()
    script, count = load_case(CASE), Count()
    case = script.build(parse_parameters(script, given))
    count.install()
    solve = [step.seconds["solve"] for step in case.simulation]
    steps = len(solve)
    table = Table(title=f"masonry wall, {steps} steps, a step in the mean; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    for heading in ("work", "times", "amount", "rate here", "floor [ms]"):
        table.add_column(heading, justify="left" if heading == "work" else "right")
    floor = 0.0
    for kind, method in KINDS.items():
        seconds = count.flops[kind] / measured[method] / steps
        floor += seconds
        amount = f"{count.flops[kind] / steps / 1e9:.3f} Gflop"
        table.add_row(kind, f"{count.calls[kind] / steps:.2f}", amount, f"{measured[method] / 1e9:.1f} Gflop/s", f"{1e3 * seconds:.1f}")
    seconds = count.bytes / measured["bytes"] / steps
    floor += seconds
    amount, speed = f"{count.bytes / steps / 1e6:.0f} MB", f"{measured['bytes'] / 1e9:.1f} GB/s"
    table.add_row("W read", f"{count.calls['Newton systems'] / steps:.2f}", amount, speed, f"{1e3 * seconds:.1f}")
    table.add_row("floor of the solve", "", "", "", f"{1e3 * floor:.1f}", style="bold")
    table.add_row("solve, measured", "", "", "", f"{1e3 * sum(solve) / steps:.1f}", style="bold")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
