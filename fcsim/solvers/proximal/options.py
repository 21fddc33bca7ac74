"""The options of the proximal point algorithm and the rules by which its regularisation alpha falls and rises."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from fcsim.errors import InputError
from fcsim.solvers.base import Options, choice

METRICS = ("identity", "compliance")
STRATEGIES = ("prox", "regularisation")
COUNTS = ("steps", "internal iterations")
FORGOTTEN = 0.7
"""Share of the alpha that failed below which the adaptive rule tries anew after a step that succeeded."""


@dataclass(frozen=True, kw_only=True)
class ProximalOptions(Options):
    """What max_iterations counts is said by `counts`: proximal steps, or the internal method's iterations.

    internal             name of the method that solves the regularised problems; internal_options: its options where not the default
    strategy             "prox": the centre moves to each solution; "regularisation": the centre stays 0 and alpha falls by sigma
                         at each step (Tikhonov), which ends where the internal method fails or alpha passes alpha_least
    metric               D of alpha D: "identity" times the mean of W's diagonal, "compliance": each contact's own, tr(W_aa) / d, so that
                         contacts of light and of heavy bodies make equal steps
    alpha                first (or constant) regularisation
    alpha_rule           "constant"; "error": sigma error^nu; "adaptive": divided by sigma after a step whose inner problem was easy
                         (within `easy` internal iterations)
    relaxation           omega of r_k+1 = r_k + omega (new - r_k)
    forgotten            share of the alpha that failed below which the adaptive rule tries anew after a step that succeeded, this share of
                         a share after two
    internal_error_ratio inner problems are solved to error / ratio
    patience             proximal steps without a better error before giving up

    Whatever the rule, alpha is raised tenfold where the internal method fails, and stays there but for the adaptive rule, which comes
    down again and forgets step by step below which alpha it failed.
    """

    max_iterations: int = 1000
    counts: str = "steps"
    internal: str = "NSN-AC"
    internal_options: Mapping[str, object] = field(default_factory=dict)
    strategy: str = "prox"
    metric: str = "identity"
    alpha: float = 1e-4
    alpha_rule: str = "adaptive"
    alpha_least: float = 1e-9
    sigma: float = 5.0
    nu: float = 1.0
    easy: int = 8
    forgotten: float = FORGOTTEN
    relaxation: float = 1.0
    internal_error_ratio: float = 10.0
    patience: int = 50

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, known in (("counts", COUNTS), ("strategy", STRATEGIES), ("metric", METRICS), ("alpha_rule", tuple(ALPHA_RULES))):
            choice(name, getattr(self, name), known)
        self.numbers_above(alpha=0, alpha_least=0, sigma=0, internal_error_ratio=0)
        self.numbers_from(nu=0)
        if not 0 < self.forgotten <= 1:
            raise InputError(f"option forgotten: expected a number in (0, 1], got {self.forgotten}")
        if not 0 < self.relaxation < 2:
            raise InputError(f"option relaxation: expected a number in (0, 2), got {self.relaxation}")
        self.integers_from(easy=1, patience=1)


def _constant(alpha: float, error: float, iterations: int, options: ProximalOptions) -> float:
    return options.alpha


def _error(alpha: float, error: float, iterations: int, options: ProximalOptions) -> float:
    return options.sigma * error**options.nu


def _adaptive(alpha: float, error: float, iterations: int, options: ProximalOptions) -> float:
    return alpha / options.sigma if iterations <= options.easy else alpha


ALPHA_RULES: dict[str, Callable[[float, float, int, ProximalOptions], float]] = {
    "constant": _constant,
    "error": _error,
    "adaptive": _adaptive,
}
"""next alpha = rule(alpha, error of the iterate, iterations of the last inner problem, options)."""


RISE = 10.0
"""Factor of alpha where an inner problem fails."""


@dataclass(frozen=True)
class Regularisation:
    """alpha, and the least that it may fall to."""

    alpha: float
    least: float

    @classmethod
    def first(cls, error: float, options: ProximalOptions) -> Regularisation:
        """Where the algorithm begins, from an iterate of that error."""
        alpha = _error(0.0, error, 0, options) if options.alpha_rule == "error" else options.alpha
        return cls(alpha, options.alpha_least)

    def after_success(self, error: float, iterations: int, options: ProximalOptions) -> Regularisation:
        """After an inner problem that was solved within so many iterations."""
        alpha = max(ALPHA_RULES[options.alpha_rule](self.alpha, error, iterations, options), self.least)
        return Regularisation(
            alpha, max(options.forgotten * self.least, options.alpha_least) if options.alpha_rule == "adaptive" else self.least
        )

    def after_failure(self, options: ProximalOptions) -> Regularisation:
        """After one that was not; the adaptive rule finds its way down again by itself, but not at once to what failed."""
        alpha = RISE * self.alpha
        return Regularisation(alpha, self.alpha if options.alpha_rule == "adaptive" else alpha)

    def fallen(self, options: ProximalOptions) -> Regularisation:
        """The next one of Tikhonov's."""
        return replace(self, alpha=self.alpha / options.sigma)


PROXIMAL_NEWTON = ProximalOptions(
    max_iterations=10_000,
    counts="internal iterations",
    internal_options={"max_iterations": 8},
    metric="compliance",
    alpha=1e-2,
    sigma=3.0,
    easy=4,
    patience=500,
)
"""PROX-NEWTON of the table, and what `auto` begins with."""
