"""What sweeps and Newton's methods are expected to need from where a race is, and whether what others still cost is more than that."""

from __future__ import annotations

from dataclasses import dataclass

from fcsim.solvers.automatic.closed import closed, edges, faces, held_as_blocks, in_single_points, kept
from fcsim.solvers.automatic.race import Race, Runner

FAR = 1e-3
"""Error above which ADMM is tried, and Newton takes long."""


@dataclass(frozen=True)
class Expected:
    """Iterations: what a method needs, about, from errors above `FAR` and from below."""

    far: float
    near: float

    def here(self, race: Race) -> float:
        """From the race's best iterate."""
        return self.far if race.best > FAR else self.near


NEWTON = Expected(20, 7)
LOOSE, EDGES, FACES = Expected(60, 30), Expected(20, 10), Expected(8, 4)
"""Proximal Newton where bodies touch loosely, where edges of 2D bodies hold one another, and where faces do. In beds of grains it has to
find out which contacts slide, for which it takes 30 to 400 iterations, and sweeps get on; a wall of bricks takes it 10 to 25, and sweeps
hundreds for each tenfold, since four points a face share their load in many ways."""
PROXIMAL_ALONE, PROXIMAL_DECADE = 20, 10
"""Iterations that proximal Newton needs where all goes well: they are its own before it shares with others, and more for each tenfold."""
SETTLED = 10
"""Times `probe` sweeps after which a last quarter that made the error no tenth smaller says that they are at an end."""
BELIEVED, BELIEVED_OF_FACES = 10, 2
"""Iterations of Newton whose cost the sweeps of a problem of few contacts spend before their rate is believed, as in `small.door`; and
where faces hold one another."""
LED = 40
"""Iterations of proximal Newton whose cost sweeps spend in beds of grains before it begins. From 1300, 800, 500, 300 and 200 sweeps it took
6, 9, 20, 38, 48 iterations on a bed of rocks, 15, 17, 16, 20, 22 on one of unlike masses, 33, 33, 13, more than 300, 195 on one of large
friction. 72 beds of rocks and large friction to 1e-4 with 15, 40 and 60: 6.61, 3.78, 4.07 s, counted."""
LED_IN_W = 60
"""The same where it eliminates in W, as in beds of discs and spheres, which costs most: NNCG finds out which contacts hold at a stroke
after long plateaus, of 38 beds of discs to 1e-8 in 161 to 3400 sweeps on 25. 28 beds of spheres to 1e-8 with none, 40 and 60: 4.5, 4.4,
3.7 s, counted. From a warm start, in beds in motion, `LED`: nine hard steps to 1e-4 with none, 20, 40 and 60 3.1, 1.9, 1.6, 1.7 s."""


def swept(race: Race) -> float:
    """What the sweeps will still cost; nothing as long as none was done, infinite where they are left out or stand still."""
    if "sweeps" in race.options.without:
        return float("inf")
    runner = race.runners.get("sweeps")
    if runner is None or not runner.spent:
        return 0.0
    if runner.monitor.iterations >= SETTLED * race.options.probe and runner.gain(1 / 4) < 1 / 0.9:
        return float("inf")  # what they need by the second half of their course would say so later
    return runner.needs()


def at_first(runner: Runner) -> bool:
    """Whether proximal Newton is in those of its iterations that are its own."""
    return runner.monitor.iterations < PROXIMAL_ALONE + PROXIMAL_DECADE * runner.decades()


def proximal_newton(race: Race) -> Expected:
    """What proximal Newton is expected to need."""
    if faces(race):
        return FACES
    return EDGES if edges(race) else LOOSE


def dearer_than_newton(race: Race, cost: float, expected: Expected = NEWTON) -> bool:
    """Whether this costs more than Newton from here; the elimination is counted only where that decides."""
    iterations, held = expected.here(race), closed(race)
    return cost > iterations * race.prices.least(held) and cost > iterations * race.prices.newton(held)


def dearer_than_proximal(race: Race, cost: float) -> bool:
    """Whether this costs more than proximal Newton from here."""
    expected = proximal_newton(race)
    if not race.prices.in_velocities:
        return dearer_than_newton(race, cost, expected)
    iterations = expected.here(race)
    return cost > iterations * race.prices.least_in_velocities and cost > iterations * race.prices.proximal(0)


def sweeps_lead_on(race: Race) -> bool:
    """Whether sweeps of a bed of grains, from zero or in motion, have yet to spend what some iterations of proximal Newton cost, which
    takes fewer from further on: they find out which contacts hold at a fraction of its price."""
    if race.joints is not None or (race.warm and not kept(race)) or held_as_blocks(race) or "sweeps" not in race.runners:
        return False
    in_w = LED_IN_W if race.problem.dimension == 2 or in_single_points(race) else 0
    led = LED if race.prices.in_velocities else min(in_w, LED if race.warm else LED_IN_W)
    return race.runners["sweeps"].spent < led * race.prices.running(closed(race))


def opening(race: Race, runner: Runner) -> bool:
    """Whether the sweeps go on before anyone else is asked: they have not yet cost as much as the iterations of Newton after which their
    rate is believed, or all of them will cost no more than Newton from here. Its elimination is not counted, which takes time itself, but
    from a warm start: there W is sparse, as in large beds in motion, and an elimination most of an iteration."""
    if not kept(race) or len(race.runners) > 1:
        return False
    prices = race.prices
    newton = prices.least_in_velocities if prices.in_velocities else prices.least(closed(race))
    believed = BELIEVED_OF_FACES if faces(race) else BELIEVED
    if runner.spent < believed * newton or runner.spent + runner.needs() < proximal_newton(race).here(race) * newton:
        return True
    return race.warm and runner.spent < believed * prices.newton(closed(race))
