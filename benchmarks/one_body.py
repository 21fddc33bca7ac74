"""One body over ranks of MPI: a block of so many cells on a plane under its weight, by one process and by several.

    python benchmarks/one_body.py 24 24 106 --ranks 1 2        columns: cells along x, y, z; 200 625 degrees of freedom
    python benchmarks/one_body.py 40 40 40 --ranks 1 2         206 763, with 1681 contacts

Each row: peak memory of the rank that has most [GiB], seconds of the first step, with its factor and the compliance on the contacts,
and of a later one, the plane's reaction less what the fall gains over the weight, how far reactions r and displacements x are from those
of the first row, relative to the largest.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy
os.environ.setdefault("FCSIM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.table import Table

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.ranks import sharing
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta

H, DENSITY, STEPS = 1e-3, 2000.0, 3


def block(cells: tuple[int, int, int]) -> Simulation:
    """A block of 1 m along x, its other sides by its cells, on a rigid plane, pushed aside by 1 m/s^2."""
    size = (1.0, cells[1] / cells[0], cells[2] / cells[0])
    model = build_model(
        [Body("block", brick("block", size, cells, Material(1e7, 0.3, DENSITY))), rigid_box("plane", (4, 4, 1), (0.5, 0.5, -0.5), 1.0)],
        supports=[Support("plane", ("x", "y", "z", "rx", "ry", "rz"))],
        gravity=lambda t: (1.0, 0.0, -9.81),
    )
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("plane", "z+")]), 0.5, 1e-1)
    return Simulation(model, Detector([pair], model.n_nodes), Theta(H), STEPS)


def rank(cells: tuple[int, int, int], folder: Path) -> None:
    """Take the steps, and write what this rank has seen."""
    with sharing() as ranks:
        simulation, ends = block(cells), [time.perf_counter()]
        model = simulation.model
        last = None
        for step in simulation:
            ends.append(time.perf_counter())
            last = step
        assert last is not None
        gain = float(model.apply_mass(last.state.v - last.previous.v)[: model.n_elastic].reshape(-1, 3)[:, 2].sum()) / H
        push = -float(last.contact_force_on(model.body_number("plane"))[2]) - gain
        block_points = model.positions(last.state.x)[: model.n_elastic // 3]
        found = {
            "dofs": model.n_elastic,
            "contacts": len(last.contacts),
            "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
            "first": ends[1] - ends[0],
            "later": ends[-1] - ends[-2],
            "weight": push / (9.81 * DENSITY * float(np.prod(np.ptp(model.reference[: len(block_points)], axis=0)))),
        }
        number = 0 if ranks is None else ranks.number
        (folder / f"{number}.json").write_text(json.dumps(found), encoding="utf-8")
        if number == 0:
            np.savez(folder / "answer.npz", r=last.result.r, x=last.state.x)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cells", type=int, nargs=3)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    cells = tuple(options.cells)
    if options.folder:
        rank(cells, options.folder)
        return
    rows: list[dict[str, float]] = []
    first: dict[str, np.ndarray] = {}
    for count in options.ranks:
        with tempfile.TemporaryDirectory() as folder:
            launcher = [str(Path(sys.executable).parent / "mpiexec"), "-n", str(count)] if count > 1 else []
            subprocess.run([*launcher, sys.executable, __file__, *map(str, cells), "--folder", folder], check=True)
            found = [json.loads((Path(folder) / f"{k}.json").read_text(encoding="utf-8")) for k in range(count)]
            answer = dict(np.load(Path(folder) / "answer.npz"))
        first = first or answer
        apart = {f"{name} apart": float(np.abs(answer[name] - first[name]).max() / np.abs(first[name]).max()) for name in ("r", "x")}
        most = {name: max(each[name] for each in found) for name in ("memory", "first", "later")}
        rows.append({"ranks": count, **found[0], **most, **apart})
    if options.json:
        sys.stdout.write(json.dumps(rows) + "\n")
        return
    table = Table("ranks", "dofs", "contacts", "GiB", "first step [s]", "a later step [s]", "reaction / weight - 1", "r apart", "x apart")
    for row in rows:
        measured = (f"{row['memory']:.2f}", f"{row['first']:.1f}", f"{row['later']:.1f}", f"{row['weight'] - 1:.1e}")
        table.add_row(
            *(str(row[name]) for name in ("ranks", "dofs", "contacts")), *measured, f"{row['r apart']:.1e}", f"{row['x apart']:.1e}"
        )
    Console(width=160).print(table)


if __name__ == "__main__":
    main()
