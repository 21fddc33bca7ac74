"""What is said of steps whose tolerance, relative to the motion that bodies would make without contact, round-off hardly leaves."""

from __future__ import annotations

from fcsim.timestep.chain import MET
from fcsim.timestep.step import Step

SCARCE = 1e-13
"""Tolerance below which methods arrive by chance: a deformable block that is pulled out from between two soft ones, which nothing but eta
holds against its weight at first, takes at most 35, 85, 860 and 13 400 iterations a load step to 1e-12, 1e-13, 1e-14 and 1e-15."""


def scarce_digits(step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on a step of contacts that was solved to less than `SCARCE`."""
    if "scarce digits" in said or not step.attempts or not len(step.contacts):
        return {}
    last = step.attempts[-1]
    if last.tol >= SCARCE:
        return {}
    helps = "a shorter step" if step.scheme.timing.moving else f"a larger eta (about {MET / last.tol:.0e} times)"
    return {
        "scarce digits": f"{when}: the error asked for is {last.tol:.1g} of the motion without contact, which leads bodies far out of the "
        f"model: round-off leaves so little that methods may take thousands of iterations ({last.iterations} here). What helps: {helps}, "
        "or a larger tolerance"
    }
