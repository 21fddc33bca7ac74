"""Options and parameters with values that nobody means: an error of ours, or an answer that is one."""

from __future__ import annotations

import contextlib
import dataclasses
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.command_line.compiling import COMPILING
from fcsim.command_line.main import main
from fcsim.export_fclib import write_fclib
from fcsim.problem import LocalProblem
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.solvers import SOLVERS, solve

Apart = Callable[[Callable[[int], str], int], list[tuple[int, str]]]
CASES = Path(__file__).parents[2] / "cases"
NUMBERS: tuple[Any, ...] = (0, 1, -1, 2, 3, 0.5, 1e20, -1e20, 10**20, 2**31, 2**63, 1e300, -1e300, 1e-300, 5e-324, 1e-20)
VALUES: tuple[Any, ...] = (
    *NUMBERS,
    float("nan"),
    float("inf"),
    float("-inf"),
    True,
    False,
    None,
    "",
    "x",
    "flase",
    "kkt",
    "\x1b[2J",
    (),
    [1],
)
TEXTS = (*map(str, VALUES), "1e400", "0x10", "1_000", "1,2", "1,2,3", "(1,2,3)", " 7 ", "٣", "on", "none")
COULOMB = [name for name, method in SOLVERS.items() if 5 not in method.dimensions]


def problem(d: int) -> LocalProblem:
    A = np.random.default_rng(0).standard_normal((3 * d, 3 * d))
    return LocalProblem(A @ A.T + np.eye(3 * d), np.tile([-1.0, 0.5, 0.2][:d], 3), np.full(3, 0.4), dimension=d)


@pytest.mark.filterwarnings("ignore")
def test_options_of_solvers(apart: Apart, how_many: Any, generator: Any) -> None:
    problems = {d: problem(d) for d in (2, 3)}
    for name in COULOMB:  # compiled here, for all children
        solve(problems[SOLVERS[name].dimensions[-1]], name, time_limit=1.0)

    def case(number: int) -> str:
        random = generator("options", number)
        name = COULOMB[int(random.integers(len(COULOMB)))]
        method = SOLVERS[name]
        fields = [field.name for field in dataclasses.fields(method.options)]
        chosen = {str(random.choice(fields)): VALUES[int(random.integers(len(VALUES)))] for _ in range(int(random.integers(1, 3)))}
        if random.random() < 0.2:
            chosen["tol"] = VALUES[int(random.integers(len(VALUES)))]
        result = solve(problems[method.dimensions[-1]], name, time_limit=1.0, **chosen)
        tol = chosen.get("tol", 1e-8)
        return "" if not result.solved or result.error <= tol < 1 else f"{name} {chosen}: SOLVED with {result.error:.1e}"

    assert not apart(case, how_many(200, 1500))


@pytest.mark.filterwarnings("ignore")
def test_options_as_texts(tmp_path: Path, apart: Apart, how_many: Any, generator: Any) -> None:
    """By the command line, which says one line and returns 2, or what it found."""
    path = write_fclib(tmp_path / "a.hdf5", problem(3))

    def case(number: int) -> str:
        random = generator("texts", number)
        name = COULOMB[int(random.integers(len(COULOMB)))]
        field = str(random.choice([field.name for field in dataclasses.fields(SOLVERS[name].options)]))
        text = TEXTS[int(random.integers(len(TEXTS)))]
        said, errors = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(errors):
            code = main(["solve", str(path), "--solver", name, "--time-limit", "1", f"--set={field}={text}"])
        lines = [line for line in errors.getvalue().splitlines() if not line.startswith(COMPILING)]  # on machines that are slow, or busy
        good = (code == 2 and len(lines) == 1 and lines[0].startswith("fcsim: ")) or (code in (0, 1) and not lines)
        return "" if good else f"{name} {field}={text!r}: {code} {errors.getvalue()[:300]}"

    assert not apart(case, how_many(60, 500))


@pytest.mark.filterwarnings("ignore")
def test_parameters_of_cases(apart: Apart, how_many: Any, generator: Any) -> None:
    """A case is built with one parameter changed: refused in one line, or built. What it costs is bounded by the limits of the child."""
    scripts = [load_case(CASES / name) for name in ("masonry_wall", "stack", "arch", "granular", "impact_bar")]
    for script in scripts:
        script.build(script.parameters())

    def case(number: int) -> str:
        random = generator("parameters", number)
        script = scripts[number % len(scripts)]
        name = str(random.choice([field.name for field in dataclasses.fields(script.parameters)]))
        script.build(parse_parameters(script, {name: TEXTS[int(random.integers(len(TEXTS)))]}))
        return ""

    assert not apart(case, how_many(30, 1000))
