"""Benches and collections by jobs of submitit on this machine, and what is said where there is no cluster."""

import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

from fcsim.bench.results import read_results
from fcsim.cluster import Cluster, run_jobs
from fcsim.command_line.main import main
from fcsim.errors import InputError

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("seconds", [0.0, float("inf"), float("nan"), -1.0])
def test_a_job_needs_a_time(seconds: float) -> None:
    with pytest.raises(InputError, match="--time-limit"):
        Cluster("jobs", seconds, 1)
    with pytest.raises(InputError, match="--jobs"):
        Cluster("jobs", 1.0, 0)


def test_nothing_to_do_needs_no_cluster(tmp_path: Path) -> None:
    assert list(run_jobs(print, [], tmp_path, Cluster("slurm", 1.0, 1), "none")) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--launcher", "jobs"], "expected --time-limit"),
        (["--launcher", "jobs", "--time-limit", "60", "--cluster-option", "partition=cpu"], "expected --launcher slurm beside it"),
        (["--cluster-option", "partition=cpu"], "expected --launcher slurm beside it"),
    ],
)
def test_launchers_that_cannot_be(
    script_folder: Path, tmp_path: Path, arguments: list[str], said: str, capsys: pytest.CaptureFixture
) -> None:
    assert main(["sweep", str(script_folder), "--over", "mu=1", "--out", str(tmp_path / "out"), *arguments]) == 2
    assert said in capsys.readouterr().err


def test_make_env_brings_what_tests_of_jobs_need() -> None:
    """They were left out, each with its reason, by every `make test`."""
    (installed,) = re.findall(r"-e '\.\[(.*)\]'", (ROOT / "tools" / "environment.sh").read_text(encoding="utf-8"))
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert "submitit" in {re.split("[<>=]", requirement)[0] for extra in installed.split(",") for requirement in extras[extra]}


def test_without_slurm_that_is_said(script_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    pytest.importorskip("submitit", reason="jobs need submitit: pip install 'fcsim[cluster]'")
    asked = ["sweep", str(script_folder), "--over", "mu=1", "--launcher", "slurm", "--time-limit", "60", "--out", str(tmp_path / "out")]
    assert main(asked) == 2
    assert "--launcher slurm: Could not detect" in capsys.readouterr().err


def fcsim(*arguments: object) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "fcsim", *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_collection_and_a_bench_by_jobs(case_folder: Path, tmp_path: Path) -> None:
    """The files are those of a build without jobs; each solve keeps its limits; a killed bench goes on, and its jobs end."""
    pytest.importorskip("submitit", reason="jobs need submitit: pip install 'fcsim[cluster]'")
    here, there = tmp_path / "here", tmp_path / "there"
    assert fcsim("collection", "build", case_folder, "--steps", 3, "--out", here).returncode == 0
    built = fcsim("collection", "build", case_folder, "--steps", 3, "--out", there, "--launcher", "jobs", "--time-limit", 300)
    assert built.returncode == 0, built.stderr
    names = sorted(path.relative_to(here) for path in here.rglob("*.hdf5"))
    assert names and names == sorted(path.relative_to(there) for path in there.rglob("*.hdf5"))
    tight = fcsim(
        "collection", "build", case_folder, "--out", tmp_path / "no", "--launcher", "jobs", "--time-limit", 300, "--memory-limit", 5
    )  # fmt: skip
    assert tight.returncode == 2 and "got: memory limit" in tight.stderr and not (tmp_path / "no").exists()

    plugin = tmp_path / "leaks.py"
    plugin.write_text(LEAK, encoding="utf-8")
    out = tmp_path / "bench"
    asked = ["bench", there, "--form", "local", "--plugin", plugin, "--solvers", "LEAK,SLEEP,NSN-AC", "--tols", "1e-4"]
    asked += ["--time-limit", 2, "--memory-limit", 300, "--launcher", "jobs", "--jobs", 2, "--out", out]
    process = subprocess.Popen(
        [sys.executable, "-m", "fcsim", *map(str, asked)], env=os.environ | {"PYTHONPATH": str(ROOT)}, stderr=subprocess.DEVNULL
    )
    while len(read_results(out) if (out / "results.csv").exists() else []) < 2:
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    done = fcsim(*asked)
    assert done.returncode == 0, done.stderr
    outcomes: dict[str, set[str]] = {}
    for measurement in read_results(out):
        outcomes.setdefault(measurement.solver, set()).add(measurement.outcome)
    assert outcomes == {"LEAK": {"KILLED_MEMORY"}, "SLEEP": {"KILLED_TIME"}, "NSN-AC": {"SOLVED"}}
    assert len(read_results(out)) == 9


LEAK = """
import dataclasses, time
from fcsim.solvers import SOLVERS

own = SOLVERS["NSGS-AC"]

def leak(problem, *others):
    held = []
    while problem.nc == 4:  # by a problem of two contacts methods are compiled
        held.append(bytearray(b"x" * 2**22))
    return own.run(problem, *others)

def sleep(problem, *others):
    while problem.nc == 4:
        time.sleep(0.1)
    return own.run(problem, *others)

SOLVERS["LEAK"] = dataclasses.replace(own, run=leak)
SOLVERS["SLEEP"] = dataclasses.replace(own, run=sleep)
"""
