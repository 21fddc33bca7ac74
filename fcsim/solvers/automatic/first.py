"""Which method is the first of `auto`, before any other has shown what it does."""

from __future__ import annotations

import scipy.sparse as sp

from fcsim.solvers.automatic.closed import (
    closed,
    held_as_blocks,
    in_blocks,
    in_small_bed,
    kept,
    newton_stays,
    on_springs,
    singular_here,
    small_and_elastic,
)
from fcsim.solvers.automatic.expected import NEWTON, dearer_than_proximal, sweeps_lead_on, swept
from fcsim.solvers.automatic.race import Race

JOINTS_SHARE = 100
"""ADMM's iterations that must bring the error down tenfold where contacts come in joints of many bodies."""


def newton_first(race: Race) -> bool:
    """Whether Newton is the first stage: in joints, be it between rigid blocks, from a warm start, and in steps of elastic bodies with few
    contacts from zero as well."""
    if not race.options.patience or singular_here(race):
        return False
    return race.joints is not None or on_springs(race) or small_and_elastic(race) or (race.warm and not _sweeps_are_cheap(race))


def _sweeps_are_cheap(race: Race) -> bool:
    """Whether a probe of sweeps costs less than one elimination of a sparse W, as that of a thousand rigid boxes (62 000 rows: 5 s)."""
    if "sweeps" in race.options.without or not sp.issparse(race.problem.W):
        return False
    probe = race.options.probe * race.prices.sweep
    held = closed(race)
    return probe < race.prices.least(held) or probe < race.prices.newton(held)


def splitting_first(race: Race) -> bool:
    """ADMM and Newton from its iterate cost clearly less than Newton from afar: many bodies in joints, whose LU is dear. Not so of bodies
    whose velocities are few: proximal Newton in these costs less than ADMM's own iterations, and ends what Newton begins. Nor where
    Newton's systems need no LU of W, or leave to the next steps what these would have to make else (`newton_stays`)."""
    if race.joints is None or race.warm or not race.options.splitting or newton_stays(race):
        return False
    prices = race.prices
    if prices.in_velocities and NEWTON.far * prices.proximal(0) < prices.splitting(JOINTS_SHARE):
        return False
    newton = prices.newton(0)
    return prices.splitting(JOINTS_SHARE) + NEWTON.near * newton < 0.7 * NEWTON.far * newton


def proximal_first(race: Race) -> bool:
    """Whether proximal Newton is the first stage: in joints of rigid bodies whose contacts hold more velocities than these have, be it only
    those that close, so that Newton's matrix is singular, be it at r = 0. Its first iterations there cost no more than a probe of sweeps
    that begin anew, as they do in joints, and bring more, from a warm start as well. Also from a warm start where edges or faces hold one
    another without joints in W, as in small walls and arches, where it takes one to ten iterations, or slide and part, without
    stiffness; and where the compiled front door has left blocks, whose sweeps cost more."""
    if not race.prices.in_velocities or "proximal Newton" in race.options.without:
        return False
    if race.passed and not (race.warm or on_springs(race) or in_small_bed(race)):
        return True
    if race.joints is None:
        return race.warm and (held_as_blocks(race) or (in_blocks(race) and not on_springs(race)))
    return singular_here(race)


def proximal_is_due(race: Race) -> bool:
    """Whether proximal Newton, or what goes before it, would begin now: as the first stage, or since sweeps cost more or are over."""
    if proximal_first(race) or (race.over("sweeps") and (race.over("Newton") or singular_here(race))):
        return True
    if not race.over("Newton"):
        return singular_here(race) and dearer_than_proximal(race, swept(race)) and not sweeps_lead_on(race)
    near = race.joints is not None or on_springs(race) or (race.warm and not kept(race))
    return near or (dearer_than_proximal(race, swept(race)) and not sweeps_lead_on(race))
