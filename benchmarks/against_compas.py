"""compas_dem's solvers beside fcsim on the same models: python benchmarks/against_compas.py [--data DIR] [MODEL ...]

Arch and barrel vault are compas_dem's templates, the dome is that of its examples (bricks of its template overlap); wall and cross vault
are the files wall.obj and crossvault.obj of compas_lmgc90's source archive (`pip download --no-deps --no-binary :all: compas_lmgc90`),
found by --data. Each solver has a process of its own, which solves the model once before the clock runs. Prints, of each model and
solver, the processor time [s], the largest force that is left on a free block over the weight of all, and the sum of the supports'
horizontal forces over their vertical ones. What is not installed or fails is named.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

MODELS = ("arch", "barrel", "dome", "wall", "crossvault")
SOLVERS = ("fcsim", "RBE", "CRA", "LMGC90")
DENSITY, G, MU = 2200.0, 9.81, 0.7
FOOT = 0.05  # of a model's height: blocks that reach down to it are held
LIMIT = 600.0  # [s] by the clock for one solver on one model


def meshes(name: str, data: Path | None) -> list[Any]:
    """The blocks of a model, as compas meshes."""
    from compas.datastructures import Mesh
    from compas_dem.templates import ArchTemplate, BarrelVaultTemplate

    if name == "arch":
        return list(ArchTemplate(rise=3, span=10, thickness=0.5, depth=0.5, n=20).blocks())
    if name == "barrel":
        return list(BarrelVaultTemplate().blocks())
    if name == "dome":
        return [Mesh.from_vertices_and_faces(*brick) for brick in dome(32, 12)]
    from fcsim.mesh.solids.surface_file import read_surfaces

    if data is None:
        raise FileNotFoundError(f"{name}.obj: --data names the folder that holds it")
    scale = 1e-2 if name == "crossvault" else 1.0  # centimetres
    return [
        Mesh.from_vertices_and_faces(solid.points.tolist(), [list(face) for face in solid.polygons])
        for solid in read_surfaces(data / f"{name}.obj", scale=scale)
    ]


def dome(around: int, up: int) -> Iterator[tuple[list[list[float]], list[tuple[int, ...]]]]:
    """Bricks of a spherical dome of 5 m and 0.3 m, rings from the oculus down: two cells of plane faces each, turned by one a ring."""
    for ring in range(up):
        for first in range(ring % 2, around + ring % 2, 2):
            places = product((first, first + 1, first + 2), (ring, ring + 1), (5.0, 5.3))
            polar = [(2 * math.pi * k / around, math.pi * (0.1 + 0.4 * row / up), r) for k, row, r in places]
            points = [[r * math.sin(b) * math.cos(a), r * math.sin(b) * math.sin(a), r * math.cos(b)] for a, b, r in polar]
            sides = [(0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6)]
            yield points, [*sides, *(tuple(k + 4 for k in side) for side in sides), (0, 1, 3, 2), (8, 10, 11, 9)]


def problem_of(blocks: list[Any]) -> tuple[Any, Any]:
    """Model and problem of meshes, those that stand lowest held, of one stone."""
    from compas_dem.elements import Block
    from compas_dem.material import Stone
    from compas_dem.models import BlockModel
    from compas_dem.problem import Problem

    heights = np.array([[mesh.vertex_coordinates(v)[2] for v in mesh.vertices()][:] for mesh in blocks], dtype=object)
    low, high = min(map(min, heights)), max(map(max, heights))
    model = BlockModel()
    for mesh, height in zip(blocks, heights, strict=True):
        block = Block.from_mesh(mesh)
        block.is_support = min(height) <= low + FOOT * (high - low)
        model.add_element(block)
    stone = Stone(density=DENSITY, Ecm=20000, poisson=0.2, fck=None, ft=None)
    model.add_material(stone)
    model.assign_material(stone, elements=list(model.elements()))
    model.compute_contacts(tolerance=1e-3)
    problem = Problem(model)
    problem.set_contact_model("MohrCoulomb", mu=MU)
    return model, problem


def solver(name: str) -> Callable[[Any, Any], Any]:
    """The function (problem, model) -> results of a solver."""
    if name == "fcsim":
        from fcsim.compas import solve

        return lambda problem, model: solve(problem, model)
    if name == "LMGC90":
        from compas_dem.analysis.lmgc90 import lmgc90_solve

        return lambda problem, model: lmgc90_solve(problem, model, duration=0.5, n_steps=100, verbose=1000)
    from compas_dem.analysis.cra import cra_solve, rbe_solve

    chosen = rbe_solve if name == "RBE" else cra_solve
    return lambda problem, model: chosen(problem, model, verbose=False)


def judged(model: Any, results: Any) -> tuple[float, float]:
    """The largest force left on a free block over the weight, and the supports' horizontal forces over their vertical ones.

    Forces of an edge (u, v) are those on u with some solvers, on v with others: the sign that leaves less is taken.
    """
    weight, held, centres = {}, set(), {}
    for block in model.elements():
        node = block.graphnode
        weight[node] = 0.0 if block.is_support else DENSITY * G * abs(float(block.modelgeometry.volume()))
        centres[node] = np.array(block.modelgeometry.centroid())
        if block.is_support:
            held.add(node)
    forces = [(edge, np.array(results.resultant_global(edge))) for edge in results.edges()]
    left = []
    for sign in (1.0, -1.0):
        net = {node: np.array([0.0, 0.0, -own]) for node, own in weight.items()}
        for (u, v), force in forces:
            net[u] = net[u] + sign * force
            net[v] = net[v] - sign * force
        left.append(max(float(np.linalg.norm(net[node])) for node in net if node not in held))
    feet = [force for (u, v), force in forces if (u in held) != (v in held)]
    across, up = sum(float(np.linalg.norm(force[:2])) for force in feet), sum(abs(float(force[2])) for force in feet)
    return min(left) / sum(weight.values()), across / up


def one(name: str, by: str, data: Path | None) -> dict[str, object]:
    """A solver's answer on a model."""
    run = solver(by)
    with contextlib.redirect_stdout(io.StringIO()):
        for _ in range(2):  # the first one loads what is compiled
            model, problem = problem_of(meshes(name, data))
            began = time.process_time()
            results = run(problem, model)
            seconds = time.process_time() - began
    left, thrust = judged(model, results)
    return {"blocks": len(list(model.elements())), "seconds": seconds, "left": left, "thrust": thrust}


def asked(name: str, by: str, data: Path | None) -> dict[str, Any]:
    """The same in a process of its own; {"failed": why} of one that does not answer."""
    command = [sys.executable, __file__, "--one", by, name, *([] if data is None else ["--data", str(data)])]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, env=os.environ | {"OMP_NUM_THREADS": "1"})
    except subprocess.TimeoutExpired:
        return {"failed": f"nothing after {LIMIT:g} s"}
    lines = [line for line in done.stdout.splitlines() if line.startswith("answer ")]
    if lines:
        return dict(json.loads(lines[-1].removeprefix("answer ")))
    said = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
    return {"failed": said[-1][:200]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", choices=[[], *MODELS], default=[], metavar="MODEL")
    parser.add_argument("--data", type=Path, help="folder of wall.obj and crossvault.obj")
    parser.add_argument("--one", choices=SOLVERS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print("answer " + json.dumps(one(options.models[0], options.one, options.data)))
        return
    print(f"{'model':12}{'solver':8}{'blocks':>7}{'seconds':>10}{'left':>10}{'thrust':>9}{'of fcsim':>10}")
    for name in options.models or MODELS:
        own = math.nan
        for by in SOLVERS:
            found = asked(name, by, options.data)
            if "failed" in found:
                print(f"{name:12}{by:8} {found['failed']}", flush=True)
                continue
            own = found["thrust"] if by == "fcsim" else own
            numbers = f"{found['blocks']:7}{found['seconds']:10.2f}{found['left']:10.1e}{found['thrust']:9.4f}{found['thrust'] / own:10.3f}"
            print(f"{name:12}{by:8}{numbers}", flush=True)


if __name__ == "__main__":
    main()
