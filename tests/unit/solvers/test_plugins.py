"""Methods of one's own: files that add to the table, and what is wrong with them."""

import ctypes
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.export_fclib import write_fclib
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import SOLVERS, solve
from fcsim.solvers.plugins import kept_apart, load_plugins, plugin_of

GOOD = """
from fcsim.solvers import SOLVERS, Method, Status
from fcsim.solvers.base import Iterate, Options

def run(problem, r, monitor, options):
    return Iterate(-problem.q, Status.SOLVED)

SOLVERS["MINE"] = Method(run, Options(), "mine", "this test")
"""
STICKS = LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3]))


@pytest.fixture(autouse=True)
def same_table() -> Iterator[None]:
    before = dict(SOLVERS)
    yield
    assert {name: SOLVERS.get(name) for name in before} == before
    SOLVERS.clear()
    SOLVERS.update(before)


def plugin(folder: Path, text: str) -> Path:
    (folder / "mine.py").write_text(text)
    return folder / "mine.py"


def test_a_method_of_ones_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, file = plugin(tmp_path, GOOD), write_fclib(tmp_path / "a.hdf5", STICKS)
    assert main(["solve", str(file), "--plugin", str(path), "--solver", "MINE"]) == 0
    assert "run: solved" in capsys.readouterr().out or "MINE" in SOLVERS
    assert main(["solvers", "--plugin", str(path)]) == 0
    assert "MINE" in capsys.readouterr().out
    first = plugin_of("MINE")
    assert len(first) == 64 and plugin_of("NSN-AC") == ""
    load_plugins([plugin(tmp_path, GOOD + "# changed\n")])
    assert plugin_of("MINE") not in ("", first)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import sys\nsys.exit(3)", r"mine\.py, line 2: SystemExit: 3"),
        ("raise ValueError('no')", r"mine\.py, line 1: ValueError: no"),
        ("def f(:\n", "SyntaxError"),
        (GOOD + 'SOLVERS["F"] = run', r"SOLVERS\['F'\] = Method\(run, Options\(\), family, source\), got a function"),
        (GOOD + 'SOLVERS["F"] = 3', "got a int"),
        (GOOD + 'SOLVERS["A,B"] = SOLVERS["MINE"]', "expected a name without commas"),
        (GOOD + 'SOLVERS["F"] = Method(None, Options(), "", "")', "with a function run"),
        (GOOD + 'SOLVERS["NSN-AC"] = run', "got a function"),
    ],
)
def test_what_is_no_method(tmp_path: Path, text: str, said: str) -> None:
    before = dict(SOLVERS)
    with pytest.raises(InputError, match=said):
        load_plugins([plugin(tmp_path, text)])
    assert before == SOLVERS


@pytest.mark.parametrize(
    ("returned", "got"), [("-problem.q", "a ndarray"), ("None", "a NoneType"), ("Iterate(problem.q[:2], Status.SOLVED)", "r of shape")]
)
def test_what_a_method_returns(tmp_path: Path, returned: str, got: str) -> None:
    load_plugins([plugin(tmp_path, GOOD.replace("Iterate(-problem.q, Status.SOLVED)", returned))])
    with pytest.raises(InputError, match=f"run: expected a method to return Iterate.*got {got}"):
        solve(STICKS, "MINE")


def test_what_a_plugin_prints_is_no_part_of_the_answer_in_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = plugin(tmp_path, GOOD.replace("    return", "    print('iterating')\n    return") + "print('loading')\n")
    file = write_fclib(tmp_path / "a.hdf5", STICKS)
    assert main(["solve", str(file), "--plugin", str(path), "--solver", "MINE", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["status"] == "SOLVED" and "loading\niterating\n" in said.err
    assert main(["solvers", "--plugin", str(path), "--json"]) == 0
    assert "MINE" in str(json.loads(capsys.readouterr().out))


def test_what_a_method_raises_is_named_with_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was a traceback and exit code 1, that of a solve that did not converge."""
    path = plugin(tmp_path, GOOD.replace("return Iterate", "raise ArithmeticError('two\\nlines')\n    return Iterate"))
    file = write_fclib(tmp_path / "a.hdf5", STICKS)
    assert main(["solve", str(file), "--plugin", str(path), "--solver", "MINE"]) == 2
    assert capsys.readouterr().err == "fcsim: --solver MINE: the plugin's method raised ArithmeticError: two\n"


OVERWRITES = """
from fcsim.solvers import SOLVERS, Method, Status
from fcsim.solvers.base import Iterate, Options

def run(problem, r, monitor, options):
    for W in (problem.W, getattr(problem.W, "data", None), problem.delassus.W):
        if hasattr(W, "fill"):
            W.fill(0.0)
    for array in (problem.q, problem.mu, monitor.mu, monitor.compliance):
        array[:] = 0.0
    return Iterate(r, Status.SOLVED)

SOLVERS["OVERWRITES"] = Method(run, Options(), "mine", "this test")
"""


def _pressed(form: str) -> LocalProblem | GlobalProblem:
    """Two contacts pressed on their support: r = 0 lets them through it."""
    q = np.array([-1.0, 0.5, 0.0, -1.0, 0.0, 0.5])
    if form == "global":
        return GlobalProblem(sp.eye_array(6, format="csc"), sp.eye_array(6, format="csc"), q, np.zeros(6), np.full(2, 0.3))
    if form == "mixed":
        return LocalProblem(np.eye(6), q, np.full(2, 0.3), np.zeros((6, 1)), -np.eye(1), np.zeros(1))
    return LocalProblem(sp.csr_array(np.eye(6)) if form == "sparse" else np.eye(6), q, np.full(2, 0.3))


@pytest.mark.parametrize("form", ["dense", "sparse", "mixed", "global"])
def test_a_method_that_overwrites_the_problem_is_judged_by_what_was_given(
    form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, file = plugin(tmp_path, OVERWRITES), write_fclib(tmp_path / "a.hdf5", _pressed(form))
    assert main(["solve", str(file), "--plugin", str(path), "--solver", "OVERWRITES", "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["status"] == "STAGNATED" and answer["published_error"] > 0.1  # r = 0 leaves u_N = -1
    given = _pressed(form)
    assert not solve(given, "OVERWRITES").solved  # called from Python, too
    assert solve(given).solved  # and what was given is as it was
    expected = _pressed(form)
    assert all(
        np.array_equal(np.asarray(getattr(given, name)), np.asarray(getattr(expected, name)))
        for name in ("mu", "w" if form == "global" else "q")
    )


def test_a_method_without_a_module_is_anothers() -> None:
    """What exec makes in a dict has None: solve ended in an AttributeError."""
    made: dict[str, object] = {}
    exec("def run(): pass", made)
    problem = _pressed("dense")
    assert kept_apart(problem, made["run"], "MINE") is not problem  # type: ignore[arg-type]


PRINTS = """
import ctypes
import os

libc = ctypes.CDLL(None)
libc.printf(b"C on loading\\n")

from fcsim.solvers import SOLVERS, Method, Status
from fcsim.solvers.base import Iterate, Options

def run(problem, r, monitor, options):
    os.write(1, b"into the descriptor\\n")
    libc.printf(b"C while solving\\n")
    return Iterate(-problem.q, Status.SOLVED)

SOLVERS["PRINTS"] = Method(run, Options(), "mine", "this test")
"""


@pytest.mark.parametrize("command", ["solve", "solvers"])
def test_what_libraries_print_is_no_part_of_the_json(command: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Also what C keeps in its buffer until the process ends: standard output is no terminal here."""
    path, file = plugin(tmp_path, PRINTS), write_fclib(tmp_path / "a.hdf5", STICKS)
    words = [str(file), "--solver", "PRINTS"] if command == "solve" else []
    assert main([command, *words, "--plugin", str(path), "--json"]) == 0
    ctypes.CDLL(None).fflush(None)
    shown = capfd.readouterr()
    assert isinstance(json.loads(shown.out), dict)
    assert "C on loading" in shown.err and ("C while solving" in shown.err) == (command == "solve")
