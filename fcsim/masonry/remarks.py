"""What must be known of an analysis beside its numbers: stones that nothing holds, joints that are not closed, falls outside the bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fcsim.arrays import FloatArray
from fcsim.contact_detection import Contacts
from fcsim.masonry.collapse import FINEST, FIRST, Bracket, pressed, tolerance_of
from fcsim.masonry.limit_analysis.analysis import LimitAnalysis
from fcsim.masonry.limit_analysis.limit import associative_limit
from fcsim.masonry.limit_analysis.wedged import only_wedged
from fcsim.masonry.problem import GRAVITY, MasonryProblem

_BELOW, _ABOVE = 0.99, 1.02
"""Shares of Coulomb's multiplier by limit analysis below which a fall is remarked upon, and of the associative one above which."""
_NOTHING = 1e-3  # of the multiplier of a fall: an associative one below it is zero
_THIN = 1e-6  # of a structure's extent: contacts that span less are one point or one line
_OTHER_GRAVITY = 2.0  # times g, or its part, is another unit of length, or another planet
_ALONG, _FLAT, _LAYERS = 0.9, 0.5, 3  # of a normal, of height and width, blocks on each other: a wall that lies on its side
_CANCELS = 1e-6  # of the largest load: what is left of loads that cancel, by a program's digits
_LARGE = 20.0  # [m] stones that are larger, in the median, are given in another unit: of 25 cm in cm or mm
_LIGHTEST, _HEAVIEST = 30.0, 12e3  # [kg/m^3] one in g/cm^3 or kN/m^3 has less, one in N/m^3 more than lead, 11.3e3
_STEEPEST, _RIGHT = 5.0, 90.0  # friction of no stone, tan 79 degrees, and degrees that an angle of friction has less of
_BEARS = 1e-3  # of the multiplier: what edges add that is said
_NAMED = 5  # blocks that are named before "and n more"


def remarks(analysis: LimitAnalysis, seen: Bracket | None) -> tuple[str, ...]:
    """Return what must be known of the model and of simulated numbers, one sentence each."""
    of_the_model = (*_of_the_model(analysis), *_of_units(analysis.problem), *_at_edges(analysis), *_of_the_end(analysis, seen))
    return (*of_the_model, *(() if seen is None else _of_the_simulation(analysis, seen)))


def _of_the_end(analysis: LimitAnalysis, seen: Bracket | None) -> list[str]:
    """What else answers, where Coulomb's law found no state and the associative one did."""
    upper = analysis.associative
    if analysis.coulomb.outcome != "undecided" or upper.outcome != "limit":
        return []
    instead = "fcsim push or tilt brackets the multiplier by simulation" if seen is None else "take the simulated multiplier"
    return [
        f"limit analysis under Coulomb's law did not converge, its last value is no limit: {instead}; above the associative "
        f"{upper.multiplier:.6g} nothing stands"
    ]


def _of_the_model(analysis: LimitAnalysis) -> list[str]:
    contacts, blocks, said = analysis.limit.contacts, analysis.problem.blocks, []
    held = np.array([block.support for block in blocks])
    names = [block.name for block in blocks]
    loose = unheld(contacts, held)
    weight = analysis.problem.acceleration(scaled=False)
    if np.any(weight) and not weight[2] < 0:
        said.append(f"the acceleration that stays, {tuple(weight.tolist())} m/s^2, does not act down: z is up")
    elif not np.any(analysis.limit.dead):
        said.append("no load stays upon the blocks: nothing presses joints together")
    g = float(np.linalg.norm(weight))
    if g and not GRAVITY / _OTHER_GRAVITY < g < GRAVITY * _OTHER_GRAVITY:
        said.append(
            f"the acceleration that stays is {g:.5g} m/s^2, far from {GRAVITY}, which a push in a --direction has: units are m, kg, s and N"
        )
    if not np.any(analysis.limit.live[analysis.limit.free]):
        said.append("no load grows upon a free block: push in a --direction, or mark loads as scaled_by_multiplier")
    if not held.any():
        said.append("no block is a support: all fall")
    elif loose.any():
        said.append(f"no chain of contacts leads to a support from {_named(names, loose)}: joints wider than the tolerance are open")
    elif lies_down(contacts, held, analysis.problem):
        said.append(
            "all blocks lie side by side on the supports, and joints face along y, as of a structure that was drawn with y up and lies "
            "on its side: z is up here. Turn it by 90 degrees about x where it is written, if it is to stand"
        )
    wedged = only_wedged(analysis.limit) & ~loose
    if wedged.any():
        said.append(
            f"nothing bears {_named(names, wedged)} from below, nor presses their joints: friction can hold them once they are wedged, "
            "which limit analysis counts; from rest they fall"
        )
    if analysis.lowest.outcome == "unbounded" and np.any(analysis.limit.live[analysis.limit.free]):
        said.append(
            "no multiplier ends what the structure bears: forces of joints are some that bear the loads that stay, one choice of many"
        )
    if _lifted(analysis):
        said.append(
            "at the multiplier the loads cancel on every block, and no joint bears anything: any motion that opens none the wrong way is a "
            "mechanism, the one shown is one choice of many"
        )
    if analysis.coulomb.dilatancy:
        said.append(
            "the rounds that find Coulomb's multiplier settle only where slip opens joints a little, by "
            f"{analysis.coulomb.dilatancy:.2g} of mu: it is that of such a mechanism"
        )
    apart = _apart(analysis)
    if apart:
        said.append(f"mu_between of {apart}: they do not touch, and it counts nowhere")
    thin = on_a_line(contacts, len(blocks), _THIN * analysis.problem.size) & ~held & ~loose
    if thin.any():
        where = "a point" if contacts.dimension == 2 else "a line or a point"
        said.append(f"others are touched along {where} alone by {_named(names, thin)}: where that bears a stone the slightest push ends it")
    return said


def _of_units(problem: MasonryProblem) -> list[str]:
    """Lengths that are none of stones in metres, and friction that is none of stones."""
    said, extents = [], [float(np.ptp(block.surface.points, axis=0).max()) for block in problem.blocks if not block.support]
    g = float(np.linalg.norm(problem.acceleration(scaled=False)))
    if extents and np.median(extents) > _LARGE and GRAVITY / _OTHER_GRAVITY < g < GRAVITY * _OTHER_GRAVITY:
        said.append(
            f"blocks are {np.median(extents):.4g} m large in the median: are lengths in mm or cm? Multipliers of accelerations are the "
            "same, forces, times and displacements are not"
        )
    if GRAVITY / _OTHER_GRAVITY < g < GRAVITY * _OTHER_GRAVITY:  # with another all units may be others
        said += _of_densities(problem)
    for mu in sorted({problem.mu, *problem.between.values()}):
        if _STEEPEST < mu < _RIGHT:
            said.append(f"mu {mu:g} is that of no stone: if it is the angle of friction in degrees, mu is {np.tan(np.deg2rad(mu)):.4g}")
    return said


def _of_densities(problem: MasonryProblem) -> list[str]:
    """Densities that are none of stones."""
    said = []
    free = [(block.name, block.density) for block in problem.blocks if not block.support and block.density is not None]
    light, heavy = [each for each in free if each[1] < _LIGHTEST], [each for each in free if each[1] > _HEAVIEST]
    for found, asked in (
        (light, "in g/cm^3 (1 is 1000 kg/m^3) or kN/m^3 (1 is 102 kg/m^3)"),
        (heavy, "a weight in N/m^3 (1 is 0.102 kg/m^3)"),
    ):
        if found:
            name, density = found[0]
            said.append(f"density {density:g} kg/m^3 of {name!r} is that of no stone: is it {asked}?")
    return said


def _at_edges(analysis: LimitAnalysis) -> list[str]:
    """What is borne where blocks meet along an edge or at a corner alone, as across the edge in which the joints of four meet at an angle:
    such edges chip, and where several normals would do contacts take one of them, or each, which bears more."""
    limit, d = analysis.limit, analysis.limit.contacts.dimension
    contacts, near, upper = limit.contacts, _THIN * analysis.problem.size, analysis.associative
    if upper.outcome != "limit":
        return []
    blocks_on_a_line = on_a_line(contacts, len(analysis.problem.blocks), near)
    pairs, place = np.unique(np.sort(contacts.bodies, axis=1), axis=0, return_inverse=True)
    thin = [
        not blocks_on_a_line[pair].any() and _one_line(contacts.point[place.ravel() == k], d, near) for k, pair in enumerate(pairs.tolist())
    ]
    at_edge = np.array(thin)[place.ravel()]
    if not at_edge.any():
        return []
    kept = np.flatnonzero(~at_edge)
    columns = (kept[:, None] * d + np.arange(d)).ravel()
    without = associative_limit(replace(limit, contacts=contacts.take(kept), H=limit.H[:, columns]))
    if without.outcome == "undecided" or not without.multiplier < (1 - _BEARS) * upper.multiplier:
        return []
    a, b = (analysis.problem.blocks[k].name for k in pairs[int(np.argmax(thin))])
    others = sum(thin) - 1
    more = f" and {others} other pair{'s' * (others > 1)} of blocks" if others else ""
    return [
        f"{a!r} and {b!r}{more} meet along an edge or at a corner alone, and limit analysis counts what they bear there: with joints alone "
        f"the associative multiplier is {without.multiplier:.6g}"
    ]


def lies_down(contacts: Contacts, held: np.ndarray, problem: MasonryProblem) -> bool:
    """Whether a structure looks as if it were drawn with y up: thinner than high and wide, each free block on one support (planks lie on
    two beams), and joints between free blocks with normals along y, none along z."""
    if contacts.dimension == 2 or not len(contacts):
        return False
    between = ~held[contacts.bodies].any(axis=1)
    normal = np.abs(contacts.frame[between, 0])
    free, on = np.flatnonzero(~held), held[contacts.bodies]
    bearing = np.unique(np.take_along_axis(contacts.bodies, np.argsort(on), axis=1)[on.any(axis=1)], axis=0)  # a free block, its support
    borne = np.array_equal(bearing[~held[bearing[:, 0]], 0], free)
    points = np.concatenate([problem.blocks[k].surface.points for k in free])
    x, y, z = np.ptp(points, axis=0)
    layers = len(np.unique(contacts.bodies[between][normal[:, 1] > _ALONG]))
    return bool(borne and z < _FLAT * min(x, y) and layers >= _LAYERS and not np.any(normal[:, 2] > 1 - _ALONG))


def _lifted(analysis: LimitAnalysis) -> bool:
    """Whether the loads at the multiplier cancel on every free block, as those that lift it by its own weight."""
    limit, least = analysis.limit, analysis.lowest
    if least.outcome != "limit":
        return False
    left = (limit.dead + least.multiplier * limit.live)[limit.free]
    return bool(np.abs(left).max(initial=0.0) <= _CANCELS * limit.scale)


def _apart(analysis: LimitAnalysis) -> str:
    """The pairs with a friction of their own that have no contact."""
    touching = {frozenset(pair) for pair in analysis.limit.contacts.bodies.tolist()}
    number, pairs = analysis.problem.number, analysis.problem.between
    return ", ".join(f"{a!r} and {b!r}" for a, b in pairs if frozenset((number[a], number[b])) not in touching)


def unheld(contacts: Contacts, held: np.ndarray) -> np.ndarray:
    """Which blocks (n,) no chain of contacts joins to one that is held."""
    n = len(held)
    a, b = contacts.bodies.T
    _, piece = connected_components(sp.coo_array((np.ones(len(a)), (a, b)), shape=(n, n)), directed=False)
    return np.asarray(~np.isin(piece, piece[held]))


def on_a_line(contacts: Contacts, count: int, near: float) -> np.ndarray:
    """Which of `count` blocks touch others along one line alone (2D: at one point), to `near` [m]."""
    found = np.zeros(count, dtype=bool)
    if not len(contacts):
        return found
    both = contacts.bodies.ravel()
    order = np.argsort(both, kind="stable")
    points = np.repeat(contacts.point, 2, axis=0)[order]
    numbers, first = np.unique(both[order], return_index=True)
    for number, own in zip(numbers, np.split(points, first[1:]), strict=True):
        found[number] = _one_line(own, contacts.dimension, near)
    return found


def _one_line(points: FloatArray, d: int, near: float) -> bool:
    """Whether points (n, d) lie on one line (2D: at one point), to `near` [m]."""
    spans = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(len(spans) < d - 1 or spans[d - 2] < near)


def _of_the_simulation(analysis: LimitAnalysis, seen: Bracket) -> list[str]:
    said, least, upper = [], analysis.lowest, analysis.associative
    gap = float(np.abs(analysis.limit.contacts.gap).max(initial=0.0))
    if seen.motion == (0.0, 0.0) and gap > 0.1 * FIRST * analysis.problem.size:
        said.append(
            f"joints are not closed exactly (to {gap:.2g} m), and close first: the structure moves under the loads that stay, its first "
            "motion under those that grow is not told; the fall is"
        )
    if least.outcome == "limit" and seen.fall[1] < _BELOW * least.multiplier:
        said.append(
            f"the simulation falls at {seen.fall[1]:.6g}, below the least multiplier that limit analysis found under Coulomb's law "
            f"({least.multiplier:.6g}): that one is no lower bound, another mechanism with slip goes before it; take the simulated one"
        )
    if upper.outcome == "limit" and seen.fall[0] > _ABOVE * upper.multiplier > _NOTHING * seen.fall[0]:
        said.append(
            f"it begins to move by {seen.motion[1]:.6g} and comes to rest again up to {seen.fall[0]:.6g}, beyond what it bears as it was "
            f"built ({upper.multiplier:.6g}): stones that have moved bear on others; take the multiplier of first motion"
        )
    longest = max((trial.t for trial in seen.trials), default=1.0)
    if tolerance_of(analysis.problem, seen.motion[1], longest) < FINEST:
        said.append(
            f"forces of {pressed(analysis.problem):.2g} times the blocks' weight act upon them: errors of the solver may move the lightest "
            "by as much as counts as first motion, whose multiplier may be too low; that of the fall is not touched"
        )
    elif any(trial.rough and trial.moves and not trial.falls for trial in seen.trials):
        said.append(
            "steps from rest did not converge to the tolerance that first motion asks for, whose multiplier may be too low; that of the "
            "fall is not touched"
        )
    return said


def _named(names: Sequence[str], chosen: np.ndarray) -> str:
    """The names of the chosen blocks, some of them where they are many."""
    found = [repr(name) for name, one in zip(names, chosen, strict=True) if one]
    return ", ".join(found[:_NAMED]) + (f" and {len(found) - _NAMED} more" if len(found) > _NAMED else "")
