"""Matrices of files that are taken as they stand, and what is said of them: halves of symmetric ones, signs, no symmetry."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.command_line.main import main
from fcsim.export_fclib import odd_matrices, write_fclib
from fcsim.problem import GlobalProblem, LocalProblem

SPD = np.array([[4.0, 1, 0, 0.5], [1, 3, 0.2, 0], [0, 0.2, 5, 1], [0.5, 0, 1, 6]])


def of_mass(M: np.ndarray) -> GlobalProblem:
    H = np.vstack([np.eye(3), np.zeros((1, 3))])
    return GlobalProblem(sp.csc_array(M), sp.csc_array(H), np.array([-1.0, 0.2, 0.1, 0.3]), np.zeros(3), np.array([0.5]))


@pytest.mark.parametrize(
    ("M", "said"),
    [
        (SPD, None),
        (np.diag(np.diag(SPD)), None),
        (np.zeros((4, 4)), None),
        (np.tril(SPD), "M has its lower triangle alone"),
        (np.triu(SPD), "M has its upper triangle alone"),
        (-SPD, "M has 4 entries < 0 on its diagonal, the first in row 0"),
        (
            SPD + 3.2 * np.eye(4)[[1, 0, 3, 2]] * np.outer([1, 1, 0, 0], [1, 1, 0, 0]),
            "M is not >= 0: its entries at (0, 1) and (1, 0) are 1.21 of the most that the diagonal allows",
        ),
        (SPD - np.diag([0, 0, 0, 6.0]), "M is not >= 0: its entries at (0, 3) and (3, 0) are inf of the most"),
        (np.ones((4, 4)), None),
        (SPD + 0.6 * (np.eye(4, k=1) - np.eye(4, k=-1)), "M is not symmetric: entries differ from those across the diagonal by up to 0.2 "),
    ],
)
def test_what_is_said_of_M(M: np.ndarray, said: str | None) -> None:
    found = odd_matrices(of_mass(M))
    assert found == () if said is None else (len(found) == 1 and found[0].startswith(said))


def test_what_is_said_of_W() -> None:
    (said,) = odd_matrices(LocalProblem(np.tril(SPD[:3, :3]), np.ones(3), np.array([0.5])))
    assert said.startswith("W has its lower triangle alone")


def test_numbers_whose_squares_and_sums_no_float_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """|q| was inf, with a warning of NumPy's, and entries across the diagonal differed by "inf of the largest"."""
    problem = LocalProblem(np.array([[1.0, 0, 1e308], [0, 1, 0], [-1e308, 0, 1]]), np.array([3e200, -4e200, 0.0]), np.array([0.5]))
    assert odd_matrices(problem)[0].endswith("by up to 2 of the largest")
    write_fclib(tmp_path / "a.hdf5", problem)
    assert main(["info", str(tmp_path / "a.hdf5")]) == 0
    said = capsys.readouterr()
    assert "|q|          5e+200\n" in said.out and not said.err


def test_commands_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A half was solved as if it were the whole, without a word."""
    half, whole = tmp_path / "half.hdf5", tmp_path / "whole.hdf5"
    write_fclib(half, of_mass(np.tril(SPD)))
    write_fclib(whole, of_mass(SPD))
    for command in ("info", "solve"):
        assert main([command, str(half)]) == 0
        assert "note: M has its lower triangle alone" in capsys.readouterr().out
        assert main([command, str(whole)]) == 0
        assert "note" not in capsys.readouterr().out
    assert main(["solve", str(half), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["remarks"]) == 1
