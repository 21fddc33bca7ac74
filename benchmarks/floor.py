"""How far the solve of a wall's step is from this machine's floor: flops and bytes counted, rates measured.

    python benchmarks/floor.py                 120 steps of cases/masonry_wall
    python benchmarks/floor.py --set divisions=16,8,8 --steps 6

Counted while the wall runs, in the condensed elimination of Newton's system (condensed.py, held.py, border.py, remainder.py in
fcsim/solvers/newton/systems): the fronts of the closed contacts' block, triangular solves and products for the border, and the LU of what
is left there; and the bytes that are read: of W, or the compliances that it is known by, and the border's columns by products, of the
border's response by the system that is left. The floor is those flops at the rates of this machine's LAPACK at like sizes and those
bytes at its memory's rate, one thread. Above it stand gathering of blocks, small arrays and Python.
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

from fcsim.linear.fronts import MultifrontalCholesky
from fcsim.linear.late.late_rows import source_of
from fcsim.problem.bodies.late import LateSum
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.solvers.newton.systems import condensed, remainder

CASE = Path(__file__).resolve().parents[1] / "cases" / "masonry_wall"
SIZE = 700
"""Unknowns of the matrices by which rates are measured, about those of the default wall's elimination."""
KINDS = {
    "Cholesky, closed contacts": "Cholesky",
    "triangular solves, border, double precision": "triangular solve",
    "triangular solves, border, single precision": "triangular solve, single precision",
    "products, border, double precision": "product",
    "products, border, single precision": "product, single precision",
    "LU of what is left, double precision": "LU",
    "LU of what is left, single precision": "LU, single precision",
}
READ = ("W", "compliances, for products with W,", "border's columns", "border's response")


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
    A_single, L_single, B_single = (np.asfortranarray(x, dtype=np.float32) for x in (A, L, B))
    S = sp.random_array((20_000, 20_000), density=0.02, rng=rng, format="csr")
    x = np.ones(20_000)
    return {
        "Cholesky": rate(n**3 / 3, lambda: sla.lapack.dpotrf(A, lower=True, clean=False)),
        "triangular solve": rate(n**3, lambda: sla.blas.dtrsm(1.0, L, B, lower=True)),
        "triangular solve, single precision": rate(n**3, lambda: sla.blas.strsm(1.0, L_single, B_single, lower=True)),
        "product": rate(2 * n**3, lambda: A @ B),
        "product, single precision": rate(2 * n**3, lambda: A_single @ B_single),
        "LU": rate(2 * n**3 / 3, lambda: sla.lapack.dgetrf(A)),
        "LU, single precision": rate(2 * n**3 / 3, lambda: sla.lapack.sgetrf(A_single)),
        "bytes": rate(12 * S.nnz, lambda: S @ x),
    }


class Count:
    """Flops and bytes by kind, counted around the elimination's methods."""

    def __init__(self) -> None:
        self.flops: defaultdict[str, float] = defaultdict(float)
        self.bytes: defaultdict[str, float] = defaultdict(float)
        self.calls: Counter[str] = Counter()

    def install(self) -> None:
        hold, extended = condensed.hold, condensed.extended
        product, solve, complete = condensed.CondensedSystem._product, condensed._Step.solve, remainder.Remainder.complete
        lu = remainder.DenseLU

        def counted_hold(W: Any, rows: Any, d: int, contacts: np.ndarray, **given: Any) -> Any:
            held = hold(W, rows, d, contacts, **given)
            if held is not None:
                self._add("Cholesky, closed contacts", sum(n**3 / 3 + n**2 * b + n * b**2 for n, b in _fronts(held)))
            return held

        def counted_extended(border: Any, held: Any, *given: Any) -> Any:
            wider = extended(border, held, *given)
            before, (k, n) = len(border.PT), wider.PT.shape
            if k > before:
                precision = _precision(wider.PT)
                self._add(f"triangular solves, border, {precision}", sum(n * n + 2 * n * b for n, b in _fronts(held)) * (k - before))
                self._add(f"products, border, {precision}", n * (k**2 - before**2))  # half of the symmetric product
            return wider

        def counted_product(this: Any, x: np.ndarray) -> np.ndarray:
            if isinstance(source := source_of(this._W), LateSum):
                self._read("compliances, for products with W,", source.shares.work.bytes)
            else:
                blocks = this._W.data if sp.issparse(this._W) else this._W
                self._read("W", blocks.nbytes * np.count_nonzero(x) / len(x))  # contacts where x is zero are left out
            result: np.ndarray = product(this, x)
            return result

        def counted_solve(this: Any, *given: Any) -> np.ndarray:
            self._read("border's columns", 2 * this._border.PT.nbytes)
            step: np.ndarray = solve(this, *given)
            return step

        def counted_complete(this: Any, x: np.ndarray, *given: Any) -> None:
            self._read("border's response", this._G.itemsize * (x.size**2 + x.shape[1] * np.count_nonzero(this._unknown) ** 2))
            complete(this, x, *given)

        def counted_lu(A: np.ndarray, overwrite: bool = False) -> Any:
            self._add(f"LU of what is left, {_precision(A)}", 2 * len(A) ** 3 / 3)
            return lu(A, overwrite)

        for owner, name, counted in (
            (condensed, "hold", counted_hold),
            (condensed, "extended", counted_extended),
            (condensed.CondensedSystem, "_product", counted_product),
            (condensed._Step, "solve", counted_solve),
            (remainder.Remainder, "complete", counted_complete),
            (remainder, "DenseLU", counted_lu),
        ):
            setattr(owner, name, counted)

    def _read(self, what: str, size: float) -> None:
        self.bytes[what] += size
        self.calls[what] += 1

    def _add(self, kind: str, flops: float) -> None:
        self.flops[kind] += flops
        self.calls[kind] += 1


def _precision(A: np.ndarray) -> str:
    return "double precision" if A.dtype == np.float64 else "single precision"


def _fronts(held: Any) -> list[tuple[int, int]]:
    """Own and border unknowns of the held factor's fronts; a dense factor is one."""
    if isinstance(held.factor, MultifrontalCholesky):
        return [(len(L), len(border)) for _, border, L, _ in held.factor._fronts]
    return [(len(held.factor._factor), 0)]


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
    for kind, method in ((kind, method) for kind, method in KINDS.items() if count.calls[kind]):
        seconds = count.flops[kind] / measured[method] / steps
        floor += seconds
        amount = f"{count.flops[kind] / steps / 1e9:.3f} Gflop"
        table.add_row(kind, f"{count.calls[kind] / steps:.2f}", amount, f"{measured[method] / 1e9:.1f} Gflop/s", f"{1e3 * seconds:.1f}")
    for what in filter(count.calls.get, READ):
        seconds = count.bytes[what] / measured["bytes"] / steps
        floor += seconds
        amount, speed = f"{count.bytes[what] / steps / 1e6:.0f} MB", f"{measured['bytes'] / 1e9:.1f} GB/s"
        table.add_row(f"{what} read", f"{count.calls[what] / steps:.2f}", amount, speed, f"{1e3 * seconds:.1f}")
    table.add_row("floor of the solve", "", "", "", f"{1e3 * floor:.1f}", style="bold")
    table.add_row("solve, measured", "", "", "", f"{1e3 * sum(solve) / steps:.1f}", style="bold")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
