"""`solve_many`: a list of problems by one method, on several threads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import Reduction
from fcsim.runtime import limited_threads
from fcsim.solvers.base import Result
from fcsim.solvers.solve import solve
from fcsim.solvers.table import method


@limited_threads()
def solve_many(
    problems: Sequence[GlobalProblem | LocalProblem | Reduction],
    solver: str = "auto",
    starts: Sequence[FloatArray | None] | None = None,
    *,
    threads: int = 1,
    **options: object,
) -> list[Result]:
    """The results of `solve(problem, solver, start, **options)` for each problem, in their order, whatever the threads.

    starts     a starting point for each problem, None: r = 0 for all
    threads    that work at a time: compiled sweeps, LAPACK and SuperLU let the others work, the Python between them does not, so that they
               pay from some ten contacts on (docs/small_problems.md)
    options    of `solve`: tol, error, floor, time_limit (of one problem), options of the method

    Raises InputError for whatever is wrong with the arguments or with a problem, which is named by its place, SingularMatrix
    alike for a problem whose M or constraints are singular; the rest is not solved.
    """
    if not isinstance(threads, int) or threads < 1:
        raise InputError(f"threads: expected a whole number >= 1, got {threads!r}")
    if "memory" in options:
        raise InputError("memory: expected none, since it belongs to one problem's contacts; see solve")
    if not isinstance(problems, Iterable):
        raise InputError(f"problems: expected a list of problems, got a {type(problems).__name__}")
    problems = list(problems)
    if not (starts is None or isinstance(starts, Iterable)):
        raise InputError(f"starts: expected a list of starting points, got a {type(starts).__name__}")
    given = [None] * len(problems) if starts is None else list(starts)
    if len(given) != len(problems):
        raise InputError(f"starts: expected one for each of {len(problems)} problems, got {len(given)}")
    method(solver)  # an unknown one is said before anything is solved

    one: Callable[..., Result] = solve  # which checks the options, too

    def answer(k: int) -> Result:
        try:
            return one(problems[k], solver, given[k], **options)
        except (InputError, SingularMatrix) as error:
            raise type(error)(f"problems[{k}]: {error}") from error

    if threads == 1 or len(problems) < 2:
        return [answer(k) for k in range(len(problems))]
    # some problems at a time: handing one over takes longer than a small one itself
    share = max(1, len(problems) // (8 * threads))
    parts = [range(first, min(first + share, len(problems))) for first in range(0, len(problems), share)]
    with ThreadPoolExecutor(threads) as pool:
        solved = list(pool.map(lambda part: [answer(k) for k in part], parts))
    return [result for part in solved for result in part]
