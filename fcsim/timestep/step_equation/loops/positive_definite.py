"""The system matrix of an iterate, which must be positive definite: the law's tangent, or another one that leads to the same answer."""

from __future__ import annotations

from fcsim.assembly.body_factors import Indefinite
from fcsim.assembly.compliance import SystemFactor
from fcsim.timestep.step_equation.equation import Equation
from fcsim.timestep.step_equation.inner_term import InnerTerm, stiffened
from fcsim.timestep.step_equation.loops.iterate import Iterate

KEPT = 1e-5
"""A body's system matrix serves on while no entry differs by more than this share of the largest."""
MOST = 1e-3  # of the first stiffness, given to bodies whose own is round-off
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
    stiffness and gets the least share of its first one that serves, and converges more slowly for it. kept: bodies keep their tangents
    and factors in it while they differ by less than `KEPT`. least: share of the first stiffness that all bodies get, whether their tangents
    are positive or not: perfectly plastic bodies at their limit have no stiffness left but round-off, which is positive as often as not.
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
    added = 0.0
    for share in _SHARES:
        blocks, added = stiffened(base, blocks, lost.body, (share - added) * weight), share
        try:
            return _prepared(base.with_tangents(blocks, kept, KEPT)), share, now.earlier is not None
        except Indefinite as error:
            lost = error
    raise lost


def _prepared(factor: SystemFactor) -> SystemFactor:
    factor.prepare()
    return factor
