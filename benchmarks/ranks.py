"""A wall over ranks of MPI: what is measured on this machine, and what is counted and predicted for a wall of 20 000 bricks to 1024 ranks.

    python benchmarks/ranks.py                                   the wall of 20 160 bricks: counts, and seconds an iteration of ADMM
    python benchmarks/ranks.py --check 192 --ranks 1 2 3 4       counts and model against a real wall on so many ranks
    python benchmarks/ranks.py --scaling 192 --ranks 1 2         steps by ADMM (--solver) to 1e-4: seconds, memory, what was sent

Walls are those of benchmarks/growth.py. Nothing of the large wall is assembled: its bricks, joints and contacts follow from courses and
bricks a course, its ranks from fcsim's partition, fronts from fcsim's symbolic elimination on the graph of the joints. The model, for the
busiest rank: bytes read by a product with W and by the fronts' two sweeps over the rate at which this code reads them; the interface's
inverse likewise; ADMM's vectors, whole on every rank; exchanges at a latency each, times the logarithm of the ranks where all take
part, and bytes over a bandwidth. Rates are measured here (--check prints them); latency and bandwidth of a network are assumptions.

Three designs are counted: *as built*, one dense interface of all ranks, vectors whole on each; and two that do not exist: *nested*,
where interface contacts are eliminated where their two sides' groups of ranks meet, by those ranks together, and vectors are exchanged
with neighbours; and *platen apart*, the same with the free platen's six velocities as unknowns in the place of its share of W, which
couples all its contacts.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy
os.environ.setdefault("FCSIM_THREADS", "1")

import numpy as np
from ranks_model import ITERATIONS, REAL, WALLS, D, Rates, counted, seconds, wall
from rich.console import Console
from rich.table import Table

from fcsim.ranks import World, sharing
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.timestep.chain import SolverSettings

CASE = Path(__file__).resolve().parents[1] / "cases" / "masonry_wall"
RHO, REPEATED = 3e-5, 15
ADMM = {"initial_rho": "norm", "rho": RHO, "rho_update": "constant"}


def predicted(bricks: int, ranks: list[int], rates: Rates) -> Table:
    built = wall(*WALLS[bricks])
    title = f"{bricks} bricks, {int(built.contacts.sum())} contacts; milliseconds an iteration, seconds a step of {ITERATIONS} iterations"
    table = Table(title=title)
    headings = (
        "ranks",
        "design",
        "contacts a rank",
        "interface",
        "W",
        "fronts",
        "interface\n[ms]",
        "vectors",
        "network",
        "sum",
        "step [s]",
    )
    for heading in (*headings, "speed-up", "factor\n[s]", "W, factor\n[GB a rank]", "MB received\na step", "exchanges"):
        table.add_column(heading, justify="right")
    one = math.nan
    for count in ranks:
        plain, apart = counted(built, count), counted(replace(built, still=np.arange(len(built.costs)) >= len(built.costs) - 2), count)
        for design, c in (("as built", plain), ("nested", plain), ("platen apart", apart)):
            if design == "nested" and (count == 1 or math.isnan(c.nested[0])):
                continue
            s = seconds(c, rates, as_built=design == "as built" or count == 1)
            one = s["iteration"] if math.isnan(one) else one
            parts = [f"{1e3 * s[name]:.1f}" for name in ("W", "fronts", "interface", "vectors", "network", "iteration")]
            cells = [str(count), design, str(c.share.contacts), str(c.interface), *parts, f"{ITERATIONS * s['iteration']:.1f}"]
            cells += [f"{one / s['iteration']:.1f}", f"{s['factor']:.1f}", f"{s['memory'] / 1e3:.1f}"]
            table.add_row(*cells, f"{ITERATIONS * s['bytes'] / 1e6:.0f}", f"{ITERATIONS * s['exchanges']:.0f}")
    return table


def timed(work: Callable[[], object], times: int) -> float:
    """Processor time [s] a call, the median."""
    spent = []
    for _ in range(times):
        begin = time.process_time()
        work()
        spent.append(time.process_time() - begin)
    return float(np.median(spent))


def own_memory(world: World | None) -> tuple[float, float]:
    """This process' peak [GiB]: resident, with the pages of libraries that others have too, and with its part of these alone.

    The kernel knows the second, PSS, only as it is now: all ranks look at once, and what a rank has let go of since its peak was its own.
    """
    with nullcontext() if world is None else world.together("memory"):
        pass  # no rank has left, which would have the others bear its part
    rows = [line.split() for name in ("smaps_rollup", "status") for line in Path(f"/proc/self/{name}").read_text().splitlines()]
    known = {row[0]: float(row[1]) / 2**20 for row in rows if len(row) == 3 and row[2] == "kB"}
    with nullcontext() if world is None else world.together("memory"):
        pass
    return known["VmHWM:"], known["Pss:"] + known["VmHWM:"] - known["VmRSS:"]


def measure(bricks: int, steps: int, tol: float, solver: str, *, parts: bool) -> None:
    """This rank's part of a simulated wall, as JSON: seconds, memory, what was sent; parts: of an iteration, with the last step's W."""
    courses, whole = WALLS[bricks]
    script = load_case(CASE)
    given = {"courses": str(courses), "blocks": str(whole + 0.5), "steps": str(steps), "gravity_last": "2"}
    with sharing() as world:
        simulation = script.build(parse_parameters(script, given)).simulation
        settings = SolverSettings(name=solver, tol=tol, options=ADMM if solver == "ADMM" else {}, fallback=())
        rows: list[tuple[float, ...]] = []
        begin = time.perf_counter(), time.process_time()
        for step in replace(simulation, solver=settings):
            now = time.perf_counter(), time.process_time()
            exchanges = 0 if world is None else world.exchanges
            rows.append((step.result.iterations, now[0] - begin[0], now[1] - begin[1], step.seconds["solve"], exchanges))
            begin = now
            if step.number == steps:
                last = step
            del step  # its W is not kept while the next one is made, as in a run
        number, sent = (0, 0) if world is None else (world.number, world.bytes)
        peak, own = own_memory(world)
        found: dict[str, Any] = {"rows": rows, "sent": sent, "peak_GiB": peak, "own_GiB": own}
        if parts:
            operator = last.reduction.local.delassus
            x, rho = np.random.default_rng(0).standard_normal(operator.size), RHO * operator.norm
            sent = 0 if world is None else world.bytes
            found["W"] = timed(lambda: operator @ x, REPEATED)
            found["a_product"] = 0 if world is None else (world.bytes - sent) / REPEATED
            start = time.process_time()
            factor = operator.factor(rho, symmetric=True)
            found["factor"] = time.process_time() - start
            found["solve"] = timed(lambda: factor.solve(x), REPEATED)
            W: Any = operator.W
            local = W if world is None else W.rows
            found |= {"blocks": len(local.indices), "contacts": local.shape[0] // D}
        Path(os.environ["RANKS_OUT"], f"{number}.json").write_text(json.dumps(found), encoding="utf-8")


def run(bricks: int, ranks: int, steps: int, tol: float, solver: str = "ADMM", *, parts: bool) -> list[dict[str, Any]]:
    """`measure` on every rank, in processes of their own."""
    with tempfile.TemporaryDirectory() as folder:
        launcher = [str(Path(sys.executable).parent / "mpiexec"), "-n", str(ranks)] if ranks > 1 else []
        command = [*launcher, sys.executable, __file__, "--measure", str(bricks), "--steps", str(steps), "--tol", str(tol)]
        command += ["--solver", solver]
        command += ["--parts"] if parts else []
        subprocess.run(command, check=True, env={**os.environ, "RANKS_OUT": folder})
        return [json.loads(Path(folder, f"{rank}.json").read_text(encoding="utf-8")) for rank in range(ranks)]


def check(bricks: int, ranks: list[int], steps: int, tol: float, rates: Rates) -> Table:
    """Counts and model beside what is measured: processor time of the busiest rank."""
    table = Table(title=f"{bricks} bricks: counted and predicted / measured; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    for heading in ("ranks", "contacts a rank", "blocks of W", "W x [ms]", "solve [ms]", "factor [s]", "kB sent by W x"):
        table.add_column(heading, justify="right")
    for count in ranks:
        c, found = counted(wall(*WALLS[bricks]), count), run(bricks, count, steps, tol, parts=True)
        s, most = (
            seconds(c, rates, as_built=True),
            {key: max(one[key] for one in found) for key in ("blocks", "contacts", "W", "solve", "factor")},
        )
        solve = s["fronts"] + s["interface"]
        sent = REAL * D * c.share.contacts * (count - 1) / 1e3
        cells = [f"{c.share.contacts} / {most['contacts']}", f"{c.share.blocks} / {most['blocks']}"]
        cells += [f"{1e3 * s['W']:.1f} / {1e3 * most['W']:.1f}", f"{1e3 * solve:.1f} / {1e3 * most['solve']:.1f}"]
        cells += [f"{s['factor']:.2f} / {most['factor']:.2f}", f"{sent:.0f} / {max(one['a_product'] for one in found) / 1e3:.0f}"]
        table.add_row(str(count), *cells)
    return table


def scaling(bricks: int, ranks: list[int], steps: int, tol: float, solver: str) -> Table:
    """Steps of a wall on so many ranks: seconds from the third on, an iteration, memory of the largest rank, see `own_memory`."""
    table = Table(
        title=f"{bricks} bricks by {solver} at {tol:g}, steps 3 to {steps}; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"
    )
    for heading in (
        "ranks",
        "step 2 [s]",
        "processor [s]",
        "steps [s]",
        "each [s]",
        "processor [s]",
        "exchanges",
        "iterations",
        "solve an\niteration [ms]",
        "processor an\niteration [ms]",
        "resident\n[GiB]",
        "its own\n[GiB]",
        "MB sent",
    ):
        table.add_column(heading, justify="right")
    for count in ranks:
        found = run(bricks, count, steps, tol, solver, parts=False)
        rows = np.array([one["rows"] for one in found])  # (ranks, steps, 5)
        later, iterations = rows[:, 2:], rows[0, 2:, 0].sum()
        clock, processor = (later[:, :, k].sum(axis=1).max() for k in (1, 2))
        cells = [f"{rows[:, 1, 1].max():.1f}", f"{rows[:, 1, 2].max():.1f}", f"{clock:.2f}"]
        cells += [" ".join(f"{x:.2f}" for x in later[:, :, 1].max(axis=0)), f"{processor:.2f}"]
        cells += [f"{rows[0, -1, 4] - rows[0, 1, 4]:.0f}", f"{iterations:.0f}"]
        cells += [
            f"{1e3 * later[:, :, 3].sum(axis=1).max() / iterations:.1f}",
            f"{1e3 * later[:, :, 2].sum(axis=1).max() / iterations:.1f}",
        ]
        cells += [f"{max(one[key] for one in found):.2f}" for key in ("peak_GiB", "own_GiB")]
        cells += [f"{sum(one['sent'] for one in found) / 1e6:.0f}"]
        table.add_row(str(count), *cells)
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bricks", type=int, default=20160, choices=tuple(WALLS), help="of the predicted wall (default 20160)")
    parser.add_argument("--check", type=int, choices=tuple(WALLS), help="a wall whose counts and times are measured too")
    parser.add_argument("--scaling", type=int, choices=tuple(WALLS), help="a wall that is simulated")
    parser.add_argument("--ranks", type=int, nargs="+", help="default 1 2 4 ... 1024; of --check and --scaling 1 2")
    parser.add_argument("--steps", type=int, default=4)
    parser.add_argument("--tol", type=float, default=1e-4)
    parser.add_argument("--solver", default="ADMM", help="of --scaling (default ADMM)")
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--parts", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        measure(options.measure, options.steps, options.tol, options.solver, parts=options.parts)
        return
    rates = Rates()
    console = Console(width=190)
    if options.check:
        console.print(check(options.check, options.ranks or [1, 2], options.steps, options.tol, rates))
    elif options.scaling:
        console.print(scaling(options.scaling, options.ranks or [1, 2], options.steps, options.tol, options.solver))
    else:
        console.print(predicted(options.bricks, options.ranks or [2**k for k in range(11)], rates))


if __name__ == "__main__":
    main()
