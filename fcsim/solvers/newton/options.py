"""The options of the nonsmooth Newton methods; the variants of the solver table are values of them."""

from __future__ import annotations

from dataclasses import dataclass

from fcsim.solvers.base import Options, choice
from fcsim.solvers.newton.formulations import FORMULATIONS
from fcsim.solvers.newton.line_search import LINE_SEARCHES, REFERENCES
from fcsim.solvers.newton.systems.choice import SYSTEMS
from fcsim.solvers.scaling import RHO_RULES


@dataclass(frozen=True, kw_only=True)
class NewtonOptions(Options):
    """formulation: AC, JM, NM, FB; rho: rule of `scaling`, times rho_factor; line_search: none (NLS), Goldstein-Price, Goldstein, Armijo,
    with at most line_search_iterations trials; reference: what the merit must fall below, "none" (monotone) or its maximum, mean or
    Zhang and Hager's weighted mean over `window` iterations; safeguard: a gradient step where Newton's direction does not exist or does
    not descend; divergence: factor of the best error beyond which the iterates are called diverged; patience: iterations that must bring
    the best error below 0.7 of what it was, else the iterates are called stagnated (0: any number); longest: times ||F||, a longer step is
    not taken and W called singular; linear: how the linear system is solved, one of `systems.choice.SYSTEMS` ("auto"
    chooses from size and density; "two-level" goes by joints and a coarse space of the bodies' motions, which must be known, see
    `systems.two_level.system`; "kkt" keeps the global or mixed form, see `kkt`).
    """

    formulation: str = "AC"
    rho: str = "split spectral norm"
    rho_factor: float = 1.0
    line_search: str = "none"
    line_search_iterations: int = 100
    reference: str = "none"
    window: int = 10
    safeguard: bool = False
    divergence: float = float("inf")
    patience: int = 0
    longest: float = float("inf")
    linear: str = "auto"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("formulation", self.formulation, FORMULATIONS)
        choice("rho", self.rho, RHO_RULES)
        choice("line_search", self.line_search, LINE_SEARCHES)
        choice("reference", self.reference, REFERENCES)
        choice("linear", self.linear, ("auto", "kkt", *SYSTEMS))
        self.numbers_above(rho_factor=0, divergence=1, longest=1)
        self.integers_from(line_search_iterations=1, window=1, patience=0)
