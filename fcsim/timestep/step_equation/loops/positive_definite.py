"""The system matrix of an iterate, which must be positive definite: the law's tangent, or another one that leads to the same answer."""

from __future__ import annotations

from fcsim.assembly.body_factors import Indefinite
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.floating import floating, stretching_quotient
from fcsim.timestep.step_equation.equation import Equation
from fcsim.timestep.step_equation.inner_term import InnerTerm, stiffened
from fcsim.timestep.step_equation.loops.iterate import Iterate

KEPT = 1e-5
"""A body's system matrix serves on while no entry differs by more than this share of the largest."""
MOST = 1e-3  # of the first stiffness, given to bodies whose own is round-off
_OF_MASS = tuple(0.0025 * 2.0**k for k in range(11))  # a rate of convergence each: a turn takes p / (4 G) under the pressure p
_SHARES = (0.01 / 1024, 0.01 / 256, 0.01 / 64, 0.01 / 16, 0.0025, 0.01, 0.04, 0.16, 0.64, 2.5)


def further_share(share: float) -> float | None:
    """The share of the first stiffness that all bodies get next, where those that supports hold would fly farther than any tolerance
    allows; None beyond `MOST`.

    At their limit load perfectly plastic bodies have lost their stiffness to round-off, and yet a driven body may hold them by contact."""
    return next((s for s in _SHARES if share < s <= MOST), None)


def positive_factor(
    equation: Equation, inner: InnerTerm, now: Iterate, kept: SystemFactor | None, least: float = 0.0
) -> tuple[SystemFactor, float, bool]:
    """The factor of the iterate's matrix, the share of the bodies' first stiffness in it, and whether its stresses are foreseen; raises
    Indefinite.

    Where the tangent at the iterate is not positive definite, in statics that with the stresses which the iterate before foresaw
    (`fcsim.assembly.nonlinear.foreseen`): it is as good near the answer, and quadratic. Where that is not either, the body has lost
    stiffness and gets the least share of its first one that serves, or of mass (`_ways`), and converges more slowly for it. kept: bodies
    keep their tangents and factors in it while they differ by less than `KEPT`. least: share of the first stiffness that all bodies get,
    whether their tangents are positive or not: perfectly plastic bodies at their limit have no stiffness left but round-off, which is
    positive as often as not.
    """
    base, weight = equation.factor, inner.scheme.elastic_weight * inner.scheme.elastic_reach
    blocks = equation.elastic.less_pressures(now.v, now.term.blocks)
    for group in base.nonlinear_groups if least else ():
        for body in group.members.tolist():
            blocks = stiffened(base, blocks, body, least * weight)
    try:
        return _prepared(base.with_tangents(blocks, kept, KEPT)), least, False
    except Indefinite as error:
        lost = error
    if now.earlier is not None:
        blocks = equation.elastic.less_pressures(now.v, inner.at(now.v, tangent=True, earlier=now.earlier).blocks)
        try:
            return _prepared(base.with_tangents(blocks, kept, KEPT)), 0.0, True
        except Indefinite as error:
            lost = error
    tried: dict[int, int] = {}  # how many of its ways each body has had
    while True:
        tried[lost.body] = tried.get(lost.body, -1) + 1
        own, most = blocks, 0.0
        for body, number in tried.items():
            ways = _ways(inner, body)
            if number == len(ways):
                raise lost
            share, of_stiffness, of_mass = ways[number]
            own, most = stiffened(base, own, body, of_stiffness * weight, of_mass * weight), max(most, share)
        try:
            return _prepared(base.with_tangents(own, kept, KEPT)), most, now.earlier is not None
        except Indefinite as error:
            lost = error


def _ways(inner: InnerTerm, body: int) -> list[tuple[float, float, float]]:
    """What a body that has lost its stiffness gets, in turn: the share, that of its first stiffness and the multiple of its mass [1/s^2].

    The first stiffness has nothing against rigid motions, and pressed bodies that supports leave one lose that first: dead forces p that
    press on both sides overturn what they meet, with p V against a turn. Contact and friction hold it, but not the matrix without them. A
    share of the mass times the quotient of stiffness and mass as the body is stretched, 4 G V against a turn, does; of iterates' changes
    alone, so that nothing is left of it in the answer, as of eta there would be."""
    quotient = 0.0
    if not inner.scheme.timing.moving and body in floating(inner.model):
        quotient = stretching_quotient(inner.model, body) or 0.0
    by_mass = [(share, 0.0, share * quotient) for share in _OF_MASS if quotient]
    return by_mass + [(share, share, share * quotient) for share in _SHARES]


def _prepared(factor: SystemFactor) -> SystemFactor:
    factor.prepare()
    return factor
