"""When ADMM enters `auto`'s race, how long it is on its way, and what share of the effort it has; see `stages`."""

from __future__ import annotations

from fcsim.solvers.automatic import methods
from fcsim.solvers.automatic.closed import edges, faces, on_springs, singular_here
from fcsim.solvers.automatic.expected import FAR, at_first, sweeps_lead_on, swept
from fcsim.solvers.automatic.first import JOINTS_SHARE, proximal_first, splitting_first
from fcsim.solvers.automatic.later import interior_is_first
from fcsim.solvers.automatic.race import LITTLE, SLOWING, Race, Runner, ShareOfMonitor
from fcsim.solvers.turns import Turns

TO_REST = 1.4
"""Factor by which the last third of ADMM's iterations brings its velocities down where bodies come to rest. Its error then stays where it
is, above 1, and is nothing at once, as that of projections onto sets that meet; where bodies move its velocities stay as they are."""
RESTING = 120
"""Iterations within which each tenfold fall of those velocities comes where ADMM is the quickest: 35 to 110 on six arches that stood after
96 to 317; 220 on an arch and a wall that took it 8629 and 812."""
BEHIND = 10.0
"""Times the best error beyond which ADMM's own is far behind."""
EDGES_ALONE = 800
"""Contacts in edges up to which ADMM waits for proximal Newton's end: 28 arches and walls in 2D of 300 and 600 contacts took 1.1 to 1.3
times as long with it beside the others, at most 1.1 times without; of 1000 and 1400 some without it 1.5 and 4.6 times. It takes some 100
to 300 iterations where bodies come to rest, however many they are; proximal Newton more the more there are."""


def enters(race: Race) -> bool:
    """Whether ADMM is due: far from a solution, where the sweeps will need more than its factor costs."""
    if not race.options.splitting:
        return False
    if race.best <= FAR:
        return False
    if splitting_first(race):
        return True
    if _proximal_before_splitting(race) or (race.warm and sweeps_lead_on(race)):
        return False
    cost, share = SLOWING * swept(race), race.options.splitting
    return cost > race.prices.least_splitting(share) and cost > race.prices.splitting(share)


def _proximal_before_splitting(race: Race) -> bool:
    """Whether proximal Newton has still to show what it does before ADMM enters: where it eliminates in the bodies' velocities, which takes
    no longer than 20 to 30 of ADMM's iterations, few of which get on where bodies move. Where joints hold more than the bodies' velocities
    they often come to rest, for which ADMM is the cheaper one: there it waits for as much as its own first iterations cost, and in edges of
    few bodies for proximal Newton's end. Piles in joints of rigid bodies it seldom solves: there it waits for proximal Newton's own
    iterations and the cost of all that it takes in joints."""
    runner = race.runners.get("proximal Newton")
    if race.joints is not None:
        return proximal_first(race) and (runner is None or _has_still_to_spend(race, runner, JOINTS_SHARE))
    if not race.prices.in_velocities or "proximal Newton" in race.options.without:
        return False
    if runner is None or (faces(race) and interior_is_first(race)) or (runner.result is None and on_springs(race)):
        return True
    if runner.result is None and not race.warm and race.problem.nc <= EDGES_ALONE and edges(race):
        return True
    if runner.result is not None or not at_first(runner):
        return False
    return race.warm or not singular_here(race) or runner.spent < race.prices.splitting(race.options.splitting)


def _has_still_to_spend(race: Race, runner: Runner, iterations: int) -> bool:
    """Whether proximal Newton goes on and is in its own iterations, or has spent less than ADMM's factor and so many iterations cost."""
    return runner.result is None and (at_first(runner) or runner.spent < race.prices.splitting(iterations))


def on_track(race: Race, runner: Runner) -> bool:
    """Each share of iterations brought the error down tenfold, and the last third of them down at all (in joints it swings longer); or all
    comes to rest."""
    if runner.rest(1 / 3) > TO_REST and (race.joints is not None or RESTING * runner.slowed() >= runner.monitor.iterations):
        return True
    if runner.decades() < runner.monitor.iterations // _iterations(race):
        return False
    return race.joints is not None or runner.monitor.iterations < 0.5 * _iterations(race) or runner.gain(1 / 3) > 1.0


def _iterations(race: Race) -> int:
    """How many iterations a share of the effort has."""
    return race.options.splitting if race.joints is None else JOINTS_SHARE


def share(race: Race) -> float:
    """ADMM does not take up another's iterate: near a solution and far behind the best one it has little hope, whatever its rate."""
    behind = race.best < FAR and race.runners["splitting"].monitor.best > BEHIND * race.best
    return LITTLE if behind else 1.0


def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
    """ADMM from zero, its factor first; where contacts come in joints with the options that suit these."""
    return methods.splitting(race, monitor, methods.SPLITTING if race.joints is None else methods.SPLITTING_OF_JOINTS)
