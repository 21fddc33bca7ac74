"""The answers to an entry of the atlas: limit analysis, rigid and deformable simulation."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from fcsim.errors import InputError, NotConverged
from fcsim.masonry.atlas.entries import Collapse, Descent, Entry, Rocking, Thickness, rocking_problem
from fcsim.masonry.atlas.shapes import one_block
from fcsim.masonry.collapse import Watch, bracket, trial
from fcsim.masonry.histories.branch import push_by_displacement
from fcsim.masonry.histories.shake import shake
from fcsim.masonry.limit_analysis.analysis import analyse
from fcsim.masonry.limit_analysis.limit import LimitLoad, associative_limit
from fcsim.masonry.limit_analysis.limit_problem import limit_problem
from fcsim.masonry.problem import MasonryProblem
from fcsim.masonry.pushes import pushed
from fcsim.masonry.structure import Stone

_NEAR, _FAR = 5e-3, 0.02
"""Shares of the multiplier to which rigid and deformable blocks are bracketed."""
_CELLS = 1.0
"""Of deformable blocks, as a share of their smallest edge."""
_HELD = 2.0  # [s] so long a structure is watched that bears no load which grows


@dataclass(frozen=True)
class Answer:
    """A row of the atlas; what was not asked or has no answer is None, and `remark` says why.

    published, published_coulomb: the number that it is held against, and that under Coulomb's law where it is another one; associative,
    coulomb: by limit analysis, span_low to span_high where Coulomb's law and the mechanism go together; still, moves: rigid blocks do not
    begin to move at, do at; stands, falls: of rigid, soft_stands, soft_falls: of deformable blocks; simulated: a number of one simulation
    """

    name: str
    blocks: int
    question: str
    published: float | None = None
    published_coulomb: float | None = None
    associative: float | None = None
    coulomb: float | None = None
    span_low: float | None = None
    span_high: float | None = None
    still: float | None = None
    moves: float | None = None
    stands: float | None = None
    falls: float | None = None
    soft_stands: float | None = None
    soft_falls: float | None = None
    simulated: float | None = None
    limit_seconds: float = 0.0
    rigid_seconds: float = 0.0
    soft_seconds: float = 0.0
    remark: str = ""
    source: str = ""


def answered(entry: Entry, *, watch: Watch = lambda trial: None) -> Answer:
    """Return the answer to an entry; errors of one kind of analysis are told in the remark of a row that has the others."""
    if isinstance(entry, Collapse):
        answer = _collapse(entry, watch)
    elif isinstance(entry, Thickness):
        answer = _thickness(entry)
    elif isinstance(entry, Rocking):
        answer = _rocking(entry)
    else:
        assert isinstance(entry, Descent)
        answer = _descent(entry)
    return replace(answer, published=entry.number, published_coulomb=entry.coulomb, source=entry.source)


def _collapse(entry: Collapse, watch: Watch) -> Answer:
    problem = entry.asked
    began = time.process_time()
    found = analyse(problem)
    answer = Answer(entry.name, _free(problem), entry.quantity, limit_seconds=time.process_time() - began)
    if found.associative.outcome != "limit":
        return _without_multiplier(entry, answer, found.associative.outcome)
    low, high = found.coulomb, found.associative
    span = low.span or (None, None)
    least = low.multiplier if low.outcome == "limit" else None
    answer = replace(answer, associative=high.multiplier, coulomb=least, span_low=span[0], span_high=span[1])
    began, remarks = time.process_time(), []
    try:
        seen = bracket(
            problem, (least or 0.5 * high.multiplier) * (1 - _NEAR), high.multiplier * (1 + _NEAR), resolution=_NEAR, watch=watch
        )
        answer = replace(answer, still=seen.motion[0], moves=seen.motion[1], stands=seen.fall[0], falls=seen.fall[1])
    except NotConverged as error:
        remarks.append(f"rigid: {error}")
    answer = replace(answer, rigid_seconds=time.process_time() - began)
    if problem.dimension == 3:
        remarks.append("deformable blocks: left out in 3D")
        return replace(answer, remark="; ".join(remarks))
    began = time.process_time()
    if all(block.support or block.density is None or block.name in _loaded(entry) for block in problem.blocks):
        remarks.append("deformable blocks: none, all have a given mass or a force upon them")
        return replace(answer, remark="; ".join(remarks))
    try:
        soft = bracket(
            problem,
            (least or high.multiplier) * (1 - _FAR),
            high.multiplier * (1 + _NEAR),
            resolution=_FAR,
            watch=watch,
            blocks="deformable",
            stone=Stone(cells=_CELLS),
        )
        answer = replace(answer, soft_stands=soft.fall[0], soft_falls=soft.fall[1])
    except NotConverged as error:
        remarks.append(f"deformable: {error}")
    return replace(answer, soft_seconds=time.process_time() - began, remark="; ".join(remarks))


def _without_multiplier(entry: Collapse, answer: Answer, outcome: str) -> Answer:
    """Whether a structure stands under its weight, or bears every multiplier."""
    if outcome == "undecided":
        return replace(answer, remark="limit analysis: did not converge")
    problem = entry.asked
    if problem.scaled and outcome == "unbounded":
        return replace(answer, associative=math.inf, remark="limit analysis: borne at every multiplier; not simulated")
    began = time.process_time()
    seen = trial(problem, 0.0, duration=_HELD)
    words = "falls" if seen.falls else "moves" if seen.moves else "stands"
    said = f"limit analysis: {'stands' if outcome == 'unbounded' else 'falls'}; simulation: {words}"
    return replace(answer, question="does it stand?", rigid_seconds=time.process_time() - began, remark=said)


def _loaded(entry: Collapse) -> set[str]:
    return {getattr(load, "block", "") for load in entry.asked.loads}


def _free(problem: MasonryProblem) -> int:
    return sum(not block.support for block in problem.blocks)


def _thickness(entry: Thickness) -> Answer:
    began = time.process_time()
    low, high = entry.low, entry.high
    problem = entry.build(high)
    if _outcome(entry, low) != "falls" or _outcome(entry, high) != "unbounded":
        raise InputError(f"{entry.name}: expected one that falls at {low:g} and stands at {high:g}")
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _outcome(entry, middle) == "unbounded" else (middle, high)
    answer = Answer(entry.name, _free(problem), entry.quantity, associative=high, coulomb=high, limit_seconds=time.process_time() - began)
    began = time.process_time()
    stands, falls = (not trial(entry.build(x), 0.0, duration=_HELD).falls for x in (1.02 * high, 0.98 * high))
    answer = replace(answer, rigid_seconds=time.process_time() - began)
    if stands and not falls:
        return replace(answer, stands=1.02 * high, falls=0.98 * high, remark="simulated 2 % above and below")
    return replace(answer, remark=f"simulated 2 % above: {'stands' if stands else 'falls'}, below: {'stands' if falls else 'falls'}")


def _outcome(entry: Thickness, thickness: float) -> str:
    found: LimitLoad = associative_limit(limit_problem(entry.build(thickness)))
    return found.outcome


def _rocking(entry: Rocking) -> Answer:
    assert entry.number is not None
    problem, began = rocking_problem(entry), time.process_time()
    seen = shake(problem, duration=1.3 * entry.number, h=entry.number / 400)
    quarter = float(seen.t[int(np.argmax(seen.turn >= 0.999 * entry.share * math.atan2(entry.half_width, entry.half_height)))])
    return Answer(entry.name, 1, entry.quantity, simulated=quarter, rigid_seconds=time.process_time() - began)


def _descent(entry: Descent) -> Answer:
    began, b, h = time.process_time(), 0.5 * entry.width, 0.5 * entry.height
    curve = push_by_displacement(pushed(one_block(entry.width, entry.height, 0.9), (1.0, 0.0, 0.0)))
    alpha, R = math.atan2(b, h), math.hypot(b, h)
    moved = R * (math.sin(alpha) - math.sin(0.5 * alpha))  # the centroid turns about the toe: along x
    multiplier = float(np.interp(moved, curve.displacement, curve.multiplier))
    return Answer(entry.name, 1, entry.quantity, simulated=multiplier, rigid_seconds=time.process_time() - began)
