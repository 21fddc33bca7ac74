"""Steps of 3D masonry in motion:

    python -m benchmarks.masonry_motion [NAME ...] [--joints rigid] [--stiffness N/m] [--tol T] [--steps N]

* corner: an L-corner of 56 rigid blocks on a table tilted to tan = 0.5 along its diagonal
* shaken: the same on ground that shakes along the diagonal, 0.6 g at 2.5 Hz
* facade: 40 rigid blocks in running bond in space, tilted out of its plane to tan = 0.5
* vault: a barrel of 96 voussoirs, springers held, tilted to tan = 0.7 across
* corner500, facade1000: 504 and 1012 blocks

--joints springs (default) or rigid; --stiffness: of every contact with springs [N/m], tangentially 0.4 times that, damped by a millisecond
times both; 0: rigid. Prints for each structure the blocks, the contacts of its steps, and of all steps but the first the processor's
milliseconds, those of the solver alone (by the clock, without detection and assembly), and how many needed more than one link of the chain
or were cut. A step whose chain fails ends the structure.
Compiled kernels are kept: a second run counts.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from benchmarks.masonry import corner, facade, on_a_floor
from fcsim.contact_detection import Everything
from fcsim.contact_law import Compliant, Gap, Springs
from fcsim.contact_law.law import Law
from fcsim.errors import NotConverged
from fcsim.masonry import Acceleration, Block, MasonryProblem, structure
from fcsim.masonry.atlas.shapes import prism
from fcsim.masonry.problem import GRAVITY
from fcsim.mesh.solids.closed_surface import ClosedSurface
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta

DIAGONAL, ACROSS = (math.sqrt(0.5), math.sqrt(0.5)), (0.0, 1.0)
STEP = 5e-3


@dataclass(frozen=True)
class Structure:
    """A problem, and the horizontal acceleration [m/s^2] of its blocks over time, along a direction."""

    problem: MasonryProblem
    direction: tuple[float, float]
    tangent: float
    shaken: Callable[[float], float] | None = None


def vault(around: int, along: int) -> Iterator[Block]:
    """A barrel of radius 1 m and thickness 0.2 m in running bond, chords straight, springers held."""
    angles = np.linspace(0.0, math.pi, around + 1)
    for k, (a, b) in enumerate(pairwise(angles)):
        ends = [0.0, *(j + (0.5 if k % 2 else 1.0) for j in range(along - (k + 1) % 2)), float(along)]
        corners = [(r * math.cos(t), r * math.sin(t)) for r, t in ((0.9, a), (1.1, a), (1.1, b), (0.9, b))]
        for j, (y0, y1) in enumerate(pairwise(ends)):
            block = prism(f"v{k}c{j}", corners, 0.4 * (y1 - y0), support=k in (0, around - 1))
            yield replace(block, surface=moved(block.surface, 0.4 * y0))


def moved(surface: ClosedSurface, y: float) -> ClosedSurface:
    """The surface moved along y [m]."""
    return replace(surface, points=surface.points + np.array([0.0, y, 0.0]))


def structures() -> dict[str, Callable[[], Structure]]:
    """By name."""

    def standing(name: str, blocks: Iterator[Block], direction: tuple[float, float]) -> Structure:
        return Structure(on_a_floor(name, 3, blocks), direction, 0.5)

    barrel = MasonryProblem("vault", 3, tuple(vault(13, 7)), 0.6, (Acceleration((0.0, 0.0, -GRAVITY)),))
    return {
        "corner": lambda: standing("corner", corner(4, 7), DIAGONAL),
        "shaken": lambda: replace(
            standing("shaken", corner(4, 7), DIAGONAL), tangent=0.0, shaken=lambda t: 0.6 * GRAVITY * math.sin(2 * math.pi * 2.5 * t)
        ),
        "facade": lambda: standing("facade", facade(8, 5), ACROSS),
        "vault": lambda: Structure(barrel, (1.0, 0.0), 0.7),
        "corner500": lambda: standing("corner500", corner(14, 18), DIAGONAL),
        "facade1000": lambda: standing("facade1000", facade(40, 25), ACROSS),
    }


def simulation(given: Structure, stiffness: float, tol: float, steps: int) -> Simulation:
    """The structure in motion from rest."""
    alpha = math.atan(given.tangent)
    x, y = given.direction
    down = Acceleration((GRAVITY * math.sin(alpha) * x, GRAVITY * math.sin(alpha) * y, -GRAVITY * math.cos(alpha)))
    loads = (down,) if given.shaken is None else (down, Acceleration((x, y, 0.0), scaled=True))
    model, _ = structure(replace(given.problem, loads=loads), multiplier=given.shaken or (lambda t: 0.0))
    law: Law = Gap()
    if stiffness:
        k, c = stiffness, 1e-3 * stiffness
        law = Compliant(Springs(normal=k, tangential=0.4 * k, normal_damping=c, tangential_damping=0.4 * c, each=True))
    detector = Everything(model, given.problem.friction)
    settings = SolverSettings(tol=tol)
    return Simulation(model, detector, Theta(STEP, law=law), steps, settings, created=np.inf, witness=None)


def measure(name: str, given: Structure, stiffness: float, tol: float, steps: int) -> None:
    """Print one line."""
    cpu, solver, contacts, errors, harder = [], [], [], [], 0
    begin, ended = time.process_time(), ""
    try:
        for step in simulation(given, stiffness, tol, steps):
            now = time.process_time()
            cpu.append(1e3 * (now - begin))
            solver.append(1e3 * sum(step.seconds.get(phase, 0.0) for phase in ("solve", "reduction")))
            contacts.append(len(step.contacts))
            errors.append(step.result.error)
            harder += step.substeps > 1 or any(attempt.status != "solved" for attempt in step.attempts)
            begin = now
    except NotConverged as refused:
        ended = f"; ended: {str(refused)[:60]}"
    if not cpu:
        print(f"{name}: no step{ended}")
        return
    whole, own = np.array(cpu[1:] or cpu), np.array(solver[1:] or solver)
    blocks = sum(not block.support for block in given.problem.blocks)
    print(
        f"{name}: {blocks} blocks, {min(contacts)} to {max(contacts)} contacts, {len(cpu)} steps, error at most {max(errors):.1e}, "
        f"step median {np.median(whole):.0f} worst {whole.max():.0f} ms, solver median {np.median(own):.0f} worst {own.max():.0f} ms, "
        f"{harder} not at once{ended}",
        flush=True,
    )


def main() -> None:
    known = structures()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*known, []], metavar="NAME")
    parser.add_argument("--joints", choices=("springs", "rigid"), default="springs")
    parser.add_argument("--stiffness", type=float, default=5e8)
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--steps", type=int, default=200)
    options = parser.parse_args()
    for name in options.names or known:
        measure(name, known[name](), options.stiffness if options.joints == "springs" else 0.0, options.tol, options.steps)


if __name__ == "__main__":
    main()
