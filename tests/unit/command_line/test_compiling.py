"""A run says that it compiles what it computes with, and does not where numba finds it in its cache."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from fcsim.command_line import compiling
from fcsim.command_line.compiling import saying_so
from fcsim.command_line.main import main
from fcsim.export_fclib import write_fclib
from fcsim.problem import LocalProblem
from fcsim.solvers import Result, solve

ROOT = Path(__file__).parents[3]
KERNEL = """
import sys
import numba
from fcsim.command_line import compiling

compiling.PATIENCE = 0.0

@numba.njit(cache=True)
def inner(x):
    return x + 1

@numba.njit(cache=True)
def outer(x):
    return 2 * inner(x)

with compiling.saying_so(print):
    assert outer(1.0) == 4 and outer(1) == 4
"""

WRAPPED = """

import numba

_built = build


def build(parameters):
    numba.njit(lambda x: x - 1)(1.0)
    return _built(parameters)
"""


def test_once_and_not_with_a_warm_cache(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, str(tmp_path / "kernel.py")]
    cold, warm = (subprocess.run(command, env=variables, capture_output=True, text=True, check=True, timeout=120) for _ in range(2))
    assert len(cold.stdout.splitlines()) == 1 and cold.stdout.startswith("compiling ")
    assert warm.stdout == ""


def test_not_of_a_kernel_or_two() -> None:
    said: list[str] = []
    with saying_so(said.append):
        assert numba.njit(lambda x: x + 1)(1.0) == 2
    assert said == []


def test_what_comes_after_the_run_is_not_listened_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "PATIENCE", 0.0)
    said: list[str] = []
    with saying_so(said.append):
        pass
    assert numba.njit(lambda x: x + 1)(1.0) == 2
    assert said == []


@pytest.mark.parametrize("option", ["", "--quiet", "--json"])
def test_of_a_run(
    option: str, case_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On standard error, none where only errors are asked for; JSON stays JSON."""
    monkeypatch.setattr(compiling, "PATIENCE", 0.0)
    (script,) = case_folder.glob("*.py")
    script.write_text(script.read_text() + WRAPPED)
    arguments = ["run", str(case_folder), "--out", str(tmp_path / "out"), "--steps", "1", "--vtk-every", "0", *filter(None, [option])]
    assert main(arguments) == 0
    said = capsys.readouterr()
    assert said.err.count("compiling what this run computes with") == (option != "--quiet")
    assert "compiling" not in said.out
    if option == "--json":
        assert json.loads(said.out)["status"] == "finished"


@pytest.mark.parametrize("option", ["", "--quiet", "--json"])
def test_of_a_solve(option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The first one on a machine took up to two minutes without a word."""
    monkeypatch.setattr(compiling, "PATIENCE", 0.0)

    def compiled(p: LocalProblem, *_: object, **__: object) -> Result:
        numba.njit(lambda x: x - 1)(1.0)
        return solve(p, "NSGS-AC")

    monkeypatch.setattr("fcsim.solvers.solve", compiled)
    write_fclib(tmp_path / "a.hdf5", LocalProblem(np.eye(3), np.array([-1.0, 0.1, 0.0]), np.array([0.5])))
    assert main(["solve", str(tmp_path / "a.hdf5"), *([option] if option else [])]) == 0
    said = capsys.readouterr()
    assert said.err.count("compiling ") == (option != "--quiet")
    if option == "--json":
        assert json.loads(said.out)["status"] == "SOLVED"
