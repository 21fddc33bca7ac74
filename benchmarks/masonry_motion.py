"""Steps of 3D masonry in motion:

    python -m benchmarks.masonry_motion [NAME ...] [--joints rigid] [--stiffness N/m] [--tol T] [--steps N]

* corner: an L-corner of 56 rigid blocks on a table tilted to tan = 0.5 along its diagonal
* shaken: the same on ground that shakes along the diagonal, 0.6 g at 2.5 Hz
* facade: 40 rigid blocks in running bond in space, tilted out of its plane to tan = 0.5
* vault: a barrel of 96 voussoirs, springers held, tilted to tan = 0.7 across
* corner500, facade1000: 504 and 1012 blocks
* bridge: an arch of 264 voussoirs, span 8.9 m, 4.8 m wide, springers held, on ground that shakes along the span, 0.5 g at 3 Hz
* dome: a hemisphere of 193 blocks, thickness 0.12 of its radius, tilted to tan = 0.6
* colonnade: 12 columns of 12 drums, capitals, architraves and a cornice, on ground that shakes along the diagonal, 0.35 g at 1 Hz
* opening: a wall of 219 blocks with an opening and its lintel, on ground that shakes along the diagonal, 0.6 g at 2.5 Hz

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

import numpy as np

from benchmarks.masonry import corner, facade, on_a_floor
from benchmarks.masonry_shapes import barrel, colonnade, opening
from fcsim.contact_detection import Everything
from fcsim.contact_law import Compliant, Gap, Springs
from fcsim.contact_law.law import Law
from fcsim.errors import NotConverged
from fcsim.masonry import Acceleration, Block, MasonryProblem, structure
from fcsim.masonry.atlas.shapes import dome
from fcsim.masonry.problem import GRAVITY
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


def structures() -> dict[str, Callable[[], Structure]]:
    """By name."""

    def standing(name: str, blocks: Iterator[Block], direction: tuple[float, float]) -> Structure:
        return Structure(on_a_floor(name, 3, blocks), direction, 0.5)

    def shaking(problem: MasonryProblem, direction: tuple[float, float], share: float, frequency: float) -> Structure:
        return Structure(problem, direction, 0.0, lambda t: share * GRAVITY * math.sin(2 * math.pi * frequency * t))

    def vaulted(name: str, blocks: Iterator[Block]) -> MasonryProblem:
        return MasonryProblem(name, 3, tuple(blocks), 0.6, (Acceleration((0.0, 0.0, -GRAVITY)),))

    bridge = vaulted("bridge", barrel(33, 8, radius=5.0, thickness=0.5, width=0.6, embrace=2.2))
    shell = replace(dome(0.12, rings=9, sectors=24, mu=0.6), loads=(Acceleration((0.0, 0.0, -GRAVITY)),))
    return {
        "corner": lambda: standing("corner", corner(4, 7), DIAGONAL),
        "shaken": lambda: shaking(on_a_floor("shaken", 3, corner(4, 7)), DIAGONAL, 0.6, 2.5),
        "facade": lambda: standing("facade", facade(8, 5), ACROSS),
        "vault": lambda: Structure(vaulted("vault", barrel(13, 7)), (1.0, 0.0), 0.7),
        "bridge": lambda: shaking(bridge, (1.0, 0.0), 0.5, 3.0),
        "dome": lambda: Structure(shell, (1.0, 0.0), 0.6),
        "colonnade": lambda: shaking(on_a_floor("colonnade", 3, colonnade(12, 12)), DIAGONAL, 0.35, 1.0),
        "opening": lambda: shaking(on_a_floor("opening", 3, opening(12, 20, (4, 8, 6, 14))), DIAGONAL, 0.6, 2.5),
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
