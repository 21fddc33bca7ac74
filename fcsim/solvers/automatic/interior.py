"""The interior points of `auto`: IPM-COULOMB from zero, or from the iterate that others have come to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.solvers.automatic.closed import held_as_blocks, in_small_bed
from fcsim.solvers.automatic.race import Race, ShareOfMonitor
from fcsim.solvers.base import Status
from fcsim.solvers.interior_point.coulomb import WEIGHTS, InteriorPointOptions, interior_point_turns
from fcsim.solvers.turns import Turns

INTERIOR = InteriorPointOptions(paths=3)
"""Of 44 runs of up to six central paths in beds of grains that arrived, from zero and from iterates of sweeps and of proximal Newton, 40
took at most three."""
INTERIOR_OF_SMALL_BEDS = InteriorPointOptions()
"""From zero each path begins at the best point of those before it, which nears a solution; from an iterate that is better than all of
them each begins at that again. Of 31 beds that are hard at 1e-8, 13 were solved from zero by up to six paths."""
INTERIOR_OF_BEDS = replace(INTERIOR_OF_SMALL_BEDS, weights=(WEIGHTS[2], *WEIGHTS[:2], *WEIGHTS[3:]))
"""The same with the path first on which tau is the same for all contacts: from zero it solves eight of ten beds of rocks in some 30
iterations, the one by compliances three."""
INTERIOR_FIRST = InteriorPointOptions(paths=1)
"""Of 31 layers of boxes and ten walls of 1400 to 1900 contacts 38 came to 1e-4 by the first path from zero, in 13 to 50 iterations."""
INTERIOR_FROM_SWEEPS = InteriorPointOptions(paths=1, weights=WEIGHTS[2:3])
"""One path, tau the same for all contacts."""
NEAR, NEARER = 10.0, 3.0
"""Times the root of the error of the sweeps' iterate: velocities, over ||q|| / sqrt(nc), with which the first and the second path from
there begin. Of 28 beds with noise on W that sweeps leave at 1e-8 the first solves 15, from zero nine, of 14 of spheres nine and four. From
iterates of proximal Newton, be they better, fewer arrive, and with large friction hardly any from sweeps."""


def interior(race: Race, monitor: ShareOfMonitor) -> Turns:
    """IPM-COULOMB, in blocks from the best iterate, which it moves inside the cones, elsewhere from zero; where W of a bed is eliminated
    from that of sweeps before."""
    if in_small_bed(race):
        return _interior(race, monitor, np.zeros_like(race.start), INTERIOR_OF_SMALL_BEDS)
    if held_as_blocks(race):
        return _interior(race, monitor, race.best_r(), INTERIOR)
    if race.prices.in_velocities:
        return _interior(race, monitor, np.zeros_like(race.start), INTERIOR_OF_BEDS)
    return _from_sweeps(race, monitor)


def _from_sweeps(race: Race, monitor: ShareOfMonitor) -> Turns:
    """A path from the best iterate of sweeps, then another one from nearer to the best that they have then, then those from zero."""
    for near in (NEAR, NEARER):
        r, error = _of_sweeps(race)
        iterate = yield from _interior(race, monitor, r, replace(INTERIOR_FROM_SWEEPS, velocity=min(1.0, near * float(np.sqrt(error)))))
        if iterate.status in (Status.SOLVED, Status.TIME_LIMIT):
            return iterate
        yield  # a turn without an iteration: a new path would begin
    return (yield from _interior(race, monitor, np.zeros_like(race.start), INTERIOR_OF_BEDS))


def _of_sweeps(race: Race) -> tuple[FloatArray, float]:
    """The best iterate (m,) of sweeps and its error; that of all where none was swept."""
    sweeps = race.runners.get("sweeps")
    if sweeps is None or sweeps.monitor.best_r is None:
        return race.best_r(), race.best
    return sweeps.monitor.best_r, sweeps.monitor.best


def interior_first(race: Race, monitor: ShareOfMonitor) -> Turns:
    """IPM-COULOMB from zero by one path."""
    return _interior(race, monitor, np.zeros_like(race.start), INTERIOR_FIRST)


def _interior(race: Race, monitor: ShareOfMonitor, r: FloatArray, options: InteriorPointOptions) -> Turns:
    """IPM-COULOMB from r (m,), which tells the monitor of its paths."""
    paths = monitor.paths

    def told(tau: float) -> None:
        if np.isfinite(tau):
            paths[-1].append(float(np.sqrt(tau)))
        else:
            paths.append([])

    options = replace(options, max_iterations=race.options.max_iterations)
    return interior_point_turns(race.problem, r, monitor, options, told)
