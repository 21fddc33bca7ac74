"""Convergence plots: what is solved, what is drawn."""

import csv
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import scipy.sparse as sp
from PIL import Image

from fcsim.bench.reporting.convergence import Convergence, convergence_figure, ranked, solve_all, thinned
from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.export_fclib import write_fclib
from fcsim.problem import LocalProblem, error
from fcsim.solvers import solve


@pytest.fixture(scope="module")
def problem():
    rng = np.random.default_rng(5)
    factor = rng.standard_normal((24, 30))
    q = rng.standard_normal(24)
    q[::3] = -np.abs(q[::3])  # contacts approach
    return LocalProblem(sp.csr_array(factor @ factor.T), q, np.full(8, 0.5))


@pytest.fixture(scope="module")
def file(problem, tmp_path_factory):
    path = tmp_path_factory.mktemp("problem") / "Random-8.hdf5"
    write_fclib(path, problem)
    return path


def run(solver, time, errors, status="SOLVED"):
    errors = np.array(errors, dtype=float)
    return Convergence(solver, np.arange(len(errors)) * 1.0, np.array(time, float), errors, status, errors[-1], len(errors), time[-1])


def test_histories_begin_at_zero_and_end_at_the_answer(file, problem):
    runs = solve_all(file, ["NSN-AC", "NSGS-AC"], tol=1e-6)
    at_rest = error(problem, np.zeros(24))
    for one in runs:
        assert one.solved and one.error <= 1e-6
        assert one.error_history[-1] == pytest.approx(one.error, rel=1e-3, abs=1e-12)
        assert np.all(np.diff(one.time) >= 0) and np.all(np.diff(one.iteration) >= 0) and one.time[-1] <= one.seconds
    assert runs[0].iteration[0] == 0 and runs[0].error_history[0] == pytest.approx(at_rest)


def test_what_is_compiled_is_in_no_history(file, monkeypatch):
    """A warm-up that its limit ended had called the half of what the recorded solve compiled: 12 s of 2 ms."""
    compiled, calls = [0], []

    def solve_and_compile(problem, name, *, tol, error, time_limit):
        compiled[0] += len(calls) < 3
        calls.append(time_limit)
        return solve(problem, name, tol=tol, error=error)

    monkeypatch.setattr("fcsim.solvers.solve", solve_and_compile)
    monkeypatch.setattr("fcsim.bench.reporting.convergence.compiled_so_far", lambda: compiled[0])
    solve_all(file, ["NSN-AC"], time_limit=7.0)
    assert calls == [0.5, 0.5, 0.5, 0.5, 7.0]  # three that compile, one that does not, the one that counts


def test_command(file, tmp_path, capsys):
    out = tmp_path / "pictures"
    assert main(["profile", "--convergence", str(file), "--solvers", "NSN-AC,NSGS-AC", "--tol", "1e-6", "--out", str(out)]) == 0
    assert "NSN-AC: SOLVED" in capsys.readouterr().out
    pixels = np.asarray(Image.open(out / "convergence-Random-8.png").convert("RGB"))
    assert pixels.shape[1] >= 1600 and pixels.std() > 12
    text = " ".join(ElementTree.parse(out / "convergence-Random-8.svg").getroot().itertext())
    assert "NSGS-AC" in text and "tolerance 1e-6" in text and "iteration" in text
    with (out / "convergence-Random-8.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert {row["solver"] for row in rows} == {"NSN-AC", "NSGS-AC"} and float(rows[-1]["error"]) <= 1e-6


def test_curves_are_the_histories():
    runs = [run("A", [0.1, 0.2, 0.4], [1.0, 1e-3, 1e-9]), run("B", [0.1, 0.5, 2.0], [1.0, 0.5, 0.4], "TIME_LIMIT")]
    by_time, by_iteration, labels = convergence_figure(runs, "title", 1e-8).axes
    for axes, x in ((by_time, "time"), (by_iteration, "iteration")):
        for one in runs:
            assert any(
                np.array_equal(line.get_xdata(), getattr(one, x)) and np.array_equal(line.get_ydata(), one.error_history)
                for line in axes.lines
            )
        assert axes.get_yscale() == "log" and [line for line in axes.lines if line.get_marker() == "x"]
    assert [text.get_text() for text in labels.texts][:2] == ["A", "B (time limit)"]


def test_the_ranking_is_by_time_then_by_error():
    runs = [
        run("slow", [0, 3.0], [1, 1e-9]),
        run("stuck", [0, 1.0], [1, 0.5], "STAGNATED"),
        run("fast", [0, 1.0], [1, 1e-9]),
        run("near", [0, 9.0], [1, 1e-7], "TIME_LIMIT"),
    ]
    assert [runs[k].solver for k in ranked(runs)] == ["fast", "slow", "near", "stuck"]


def test_thinning_keeps_ends_and_extremes():
    x = np.linspace(0, 100, 200_000)
    y = 1 / (1 + x) + 0.01 * np.sin(50 * x) ** 2
    y[123_456], y[150_000] = 7.0, 1e-9
    kept = thinned(x, y)
    assert len(kept) < 2000 and kept[0] == 0 and kept[-1] == len(x) - 1 and {123_456, 150_000} <= set(kept.tolist())
    assert np.all(np.diff(kept) > 0) and len(thinned(x[:50], y[:50])) == 50


def test_bad_arguments(file, capsys):
    assert main(["profile", "--convergence", str(file)]) == 2
    assert "expected --solvers" in capsys.readouterr().err
    assert main(["profile", "--convergence", str(file), "--solvers", "NSN-AC", "--time-limit", "0"]) == 2
    assert "--time-limit: expected" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["profile", str(file), "--tols", "1e-4,small"])
    assert "expected numbers with commas between" in capsys.readouterr().err
    with pytest.raises(InputError, match="solver 'NONE'"):
        solve_all(file, ["NONE"])
