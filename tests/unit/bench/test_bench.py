"""fcsim bench: what hangs, crashes, leaks or lies is a result; a bench that was killed goes on without loss or repetition."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.bench.problems import entries
from fcsim.bench.results import Measurement, append, read_results
from fcsim.bench.workers.launch import WorkerProcess, cores
from fcsim.bench.workers.siconos_client import siconos_version
from fcsim.bench.workers.siconos_worker import CONFIGURATIONS
from fcsim.bench.workers.solves import chain_like
from fcsim.bench.workers.worker import Request, Settings, Worker, blank, judged
from fcsim.command_line.main import main
from fcsim.command_line.sets.measuring import SICONOS_BEST
from fcsim.errors import InputError
from fcsim.export_fclib import GlobalRollingProblem, write_fclib
from fcsim.linear.joints import FRONTS_FROM, joint_rows
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import SOLVERS, solve

ROOT = Path(__file__).parents[3]
SYSTEM_PYTHON = Path("/usr/bin/python3")

PLUGIN = '''
import ctypes, os, time
from dataclasses import replace
import numpy as np
from fcsim.solvers import SOLVERS
from fcsim.solvers.base import Iterate, Method, Options, Status
from pathlib import Path

loaded = []
NOTES = Path(os.environ.get("BENCH_NOTES", os.devnull))

def method(name):
    def add(run):
        SOLVERS[name] = Method(run, Options(), "test", "this file")
        return run
    return add

def pass_time(seconds):
    """Set the clock that measures forward: no load of the machine makes it later, as it would a short sleep."""
    now = time.perf_counter
    time.perf_counter = lambda: now() + seconds

def real(problem, r):
    """Whether this is the problem measured rather than the small one by which methods are compiled."""
    return len(r) == 3

@method("SLEEPS")
def sleeps(problem, r, monitor, options):
    if real(problem, r):
        time.sleep(60)
    return Iterate(r, Status.STAGNATED)

@method("LATE")
def late(problem, r, monitor, options):
    """Solves, late and without a look at the clock."""
    if real(problem, r):
        pass_time(100.0)
    return Iterate(exact(problem), Status.SOLVED)

@method("EXITS")
def exits(problem, r, monitor, options):
    if real(problem, r):
        os._exit(7)
    return Iterate(r, Status.STAGNATED)

@method("SEGFAULTS")
def segfaults(problem, r, monitor, options):
    if real(problem, r):
        ctypes.string_at(0)
    return Iterate(r, Status.STAGNATED)

@method("RAISES")
def raises(problem, r, monitor, options):
    if real(problem, r):
        raise ArithmeticError("two words\\nand a line")
    return Iterate(r, Status.STAGNATED)

@method("ENDS-ITS-PARENT")
def ends_its_parent(problem, r, monitor, options):
    """As where the system ends the process that reads a problem too large."""
    if real(problem, r):
        os.kill(os.getppid(), 9)
        time.sleep(60)
    return Iterate(r, Status.STAGNATED)

@method("LEAKS")
def leaks(problem, r, monitor, options):
    held = []
    while real(problem, r):
        held.append(np.ones(2**20))  # 8 MiB
        time.sleep(0.01)
    return Iterate(r, Status.STAGNATED)

@method("USES-MEMORY")
def uses_memory(problem, r, monitor, options):
    """50 MiB, which whoever watches may look at for so long as the test says, however busy the machine."""
    held = np.ones(50 * 2**17)
    if real(problem, r):
        time.sleep(float(os.environ.get("BENCH_HELD", "0")))
    return Iterate(exact(problem), Status.SOLVED)

@method("FORKS")
def forks(problem, r, monitor, options):
    """Everywhere: a copy of the process that serves took a request of its own, and a measurement was lost."""
    os.fork()
    return Iterate(r, Status.STAGNATED)

@method("LIES")
def lies(problem, r, monitor, options):
    """Has the monitor believe any error."""
    if real(problem, r):
        monitor.error = lambda r, u: 0.0
    return Iterate(r, Status.SOLVED)

@method("SLOW-AT-FIRST")
def slow_at_first(problem, r, monitor, options):
    """As where code is loaded, or compiled, on the first use of a large problem."""
    if real(problem, r) and not loaded:
        loaded.append(True)
        pass_time(100.0)
    return Iterate(exact(problem), Status.SOLVED)

@method("COMPILES")
def compiles(problem, r, monitor, options):
    """Needs on the real problem alone what takes numba longer than the limit, which is not seen in the second run."""
    if real(problem, r) and not loaded:
        loaded.append(True)
        from numba.core.event import trigger_event
        with trigger_event("numba:compile"):
            time.sleep(2.5)
        pass_time(100.0)
    return Iterate(exact(problem), Status.SOLVED)

@method("LOOKS")
def looks(problem, r, monitor, options):
    """Which processors it may use, and how many threads."""
    raise ArithmeticError(f'{sorted(os.sched_getaffinity(0))} {os.environ["OMP_NUM_THREADS"]}')

@method("NOT-A-NUMBER")
def not_a_number(problem, r, monitor, options):
    monitor.error = lambda r, u: 0.0 if real(problem, r) else 1.0
    return Iterate(np.full_like(r, np.nan), Status.SOLVED)

@method("EXACT")
def solves(problem, r, monitor, options):
    """Notes that it ran and in which process, then takes its time."""
    if real(problem, r):
        with NOTES.open("a") as file:
            file.write(f"{monitor.tol:g} {os.getpid()}\\\\n")
        time.sleep(float(os.environ.get("BENCH_LONG", "0.15")) if monitor.tol < 2e-4 else 0.15)
    return Iterate(exact(problem), Status.SOLVED)

def exact(problem):
    """The sliding block with its friction coefficient."""
    return np.array([10.0, -10.0 * problem.mu[0], 0.0]) if len(problem.q) == 3 else np.zeros_like(problem.q)
'''.replace("\\\\n", "\\n")


def noted(notes: Path) -> list[str]:
    """The tolerances of the measurements that EXACT noted: a process each, in which it runs several times."""
    return sorted(line.split()[0] for line in set(notes.read_text(encoding="utf-8").splitlines()))


def sliding_block(mu: float = 0.3) -> GlobalProblem:
    """A point of mass 2 pushed down by 10 and sideways by 5: it slides, r = (10, -10 mu, 0)."""
    eye = sp.eye_array(3, format="csc")
    return GlobalProblem(M=2 * eye, H=eye, f=np.array([-10.0, 5, 0]), w=np.zeros(3), mu=np.array([mu]))


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    path = tmp_path / "solvers_of_the_test.py"
    path.write_text(PLUGIN, encoding="utf-8")
    return path


@pytest.fixture
def block(tmp_path: Path) -> Path:
    folder = tmp_path / "problems"
    folder.mkdir()
    write_fclib(folder / "block.hdf5", sliding_block())
    return folder


@pytest.fixture(autouse=True)
def table_of_solvers() -> Iterator[None]:
    """Plugins add to the table of this process too."""
    before = dict(SOLVERS)
    yield
    SOLVERS.clear()
    SOLVERS.update(before)


def bench(*arguments: Any) -> int:
    return main(["bench", *map(str, arguments)])


def by(rows: Sequence[Measurement]) -> dict[tuple[str, float], Measurement]:
    return {(row.solver, row.tol): row for row in rows}


def test_what_solvers_do_wrong_is_recorded(block: Path, plugin: Path, tmp_path: Path) -> None:
    names = ["FORKS", "LATE", "EXITS", "SEGFAULTS", "RAISES", "ENDS-ITS-PARENT", "LEAKS", "USES-MEMORY", "LIES", "NOT-A-NUMBER"]
    names += ["NSN-AC", "2D-LEMKE"]
    out = tmp_path / "out"
    limits = ["--memory-limit", 200, "--tols", "1e-4"]
    assert bench(block, "--solvers", "SLEEPS", *limits, "--time-limit", 1, "--plugin", plugin, "--out", tmp_path / "sleeps") == 0
    assert [row.outcome for row in read_results(tmp_path / "sleeps")] == ["KILLED_TIME"]
    # a limit that no other method comes near, however busy the machine is
    limits += ["--time-limit", 60]
    assert bench(block, "--solvers", ",".join(names), *limits, "--jobs", 2, "--plugin", plugin, "--out", out) == 0
    assert (out / "results.csv").read_text(encoding="utf-8").count("\n") == len(names)  # a header, a row each but for one
    rows = {row.solver: row for row in read_results(out)}
    assert list(set(names) - set(rows)) == ["2D-LEMKE"]  # the problem has three dimensions
    assert rows["LATE"].outcome == "TIME_LIMIT" and 100 <= (rows["LATE"].seconds or 0) < 160
    assert rows["EXITS"].status == "CRASHED: exit code 7"
    assert rows["SEGFAULTS"].status == f"CRASHED: killed by signal {int(signal.SIGSEGV)}"
    assert rows["RAISES"].status == "CRASHED: ArithmeticError: two words"
    ended = f"the process that reads and judges the problem ended, signal {int(signal.SIGKILL)}"
    assert rows["ENDS-ITS-PARENT"].status == f"CRASHED: {ended}"
    assert rows["LEAKS"].outcome == "KILLED_MEMORY"
    assert rows["LIES"].outcome == "STAGNATED"  # solve computes the error anew, so that a method's word does not count
    # without reactions u = (-5, 2.5, 0): -(u + g(u)) = (4.25, -2.5, 0) projects on the cone's edge at ((4.25 + 0.75) / 1.09) (1, -0.3)
    assert rows["LIES"].error == pytest.approx(5 / 1.09 * np.hypot(1, 0.3) / np.hypot(5, 2.5))
    assert rows["NOT-A-NUMBER"].outcome == "STAGNATED" and rows["NOT-A-NUMBER"].error == np.inf
    lie = replace(rows["LIES"], status="SOLVED")
    assert judged(lie).outcome == "WRONG" and not judged(lie).solved  # should solve be mistaken, the judge is not
    assert judged(rows["NSN-AC"]).outcome == "SOLVED"
    assert {name for name, row in rows.items() if row.solved} == {"USES-MEMORY", "NSN-AC"}
    for name, row in rows.items():
        answered = name in ("FORKS", "LATE", "USES-MEMORY", "LIES", "NOT-A-NUMBER", "NSN-AC")
        assert (row.seconds is not None) == (row.cpu_seconds is not None) == (row.iterations is not None) == answered, name
        assert (row.problem, row.form, row.dimension, row.nc, row.n) == ("block", "global", 3, 1, 3)
        assert (row.program, row.time_limit, row.memory_limit, row.threads) == ("fcsim", 60.0, 200.0, 1)
    about = json.loads((out / "bench.json").read_text(encoding="utf-8"))
    assert about["solvers"] == names and about["time_limit"] == 60.0


def test_limits_that_are_looser_measure_again_what_they_stopped(
    block: Path, plugin: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, notes = tmp_path / "out", tmp_path / "notes"
    monkeypatch.setenv("BENCH_NOTES", str(notes))
    monkeypatch.setenv("BENCH_HELD", "60")
    base = [block, "--plugin", plugin, "--out", out, "--tols", "1e-2,1e-4"]
    assert bench(*base, "--solvers", "LATE,USES-MEMORY,EXACT", "--time-limit", 60, "--memory-limit", 20) == 0
    first = by(read_results(out))
    assert first["LATE", 1e-2].outcome == "TIME_LIMIT"
    assert first["LATE", 1e-4].status == "TIME_LIMIT: not tried: 0.01 not met in time"
    assert first["LATE", 1e-4].seconds is None
    assert {first["USES-MEMORY", tol].outcome for tol in (1e-2, 1e-4)} == {"KILLED_MEMORY"}
    assert {first["EXACT", tol].outcome for tol in (1e-2, 1e-4)} == {"SOLVED"}
    before = (out / "results.csv").read_bytes()
    for time_limit, memory_limit in ((60, 20), (50, 10)):
        limits = ["--time-limit", time_limit, "--memory-limit", memory_limit]
        assert bench(*base, "--solvers", "LATE,USES-MEMORY,EXACT", *limits) == 0
        assert (out / "results.csv").read_bytes() == before
    # a new tolerance is hopeless too; what was not tried is tried on demand
    assert bench(*base, "--solvers", "LATE", "--tols", "1e-6", "--time-limit", 60) == 0
    assert by(read_results(out))["LATE", 1e-6].outcome == "TIME_LIMIT"
    assert bench(*base, "--solvers", "LATE", "--time-limit", 60, "--no-skip-hopeless") == 0
    tried = by(read_results(out))["LATE", 1e-4]
    assert "not tried" not in tried.status and tried.outcome == "TIME_LIMIT"
    # looser limits
    monkeypatch.delenv("BENCH_HELD")
    assert bench(*base, "--solvers", "LATE,USES-MEMORY,EXACT", "--time-limit", 300, "--memory-limit", 200) == 0
    last = by(read_results(out))
    assert all(last[name, tol].solved for name in ("LATE", "USES-MEMORY", "EXACT") for tol in (1e-2, 1e-4))
    assert last["EXACT", 1e-2] == first["EXACT", 1e-2]
    assert noted(notes) == ["0.0001", "0.01"]


@pytest.fixture(scope="module")
def in_a_second(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Measurement]:
    """What methods do within a limit of one second, by their names: one process of measurements for all of them."""
    folder = tmp_path_factory.mktemp("in a second")
    write_fclib(folder / "block.hdf5", sliding_block())
    (plugin := folder / "solvers_of_the_test.py").write_text(PLUGIN, encoding="utf-8")
    call = [folder, "--plugin", plugin, "--solvers", "SLOW-AT-FIRST,COMPILES,LOOKS", "--tols", "1e-4", "--time-limit", 1]
    before = dict(SOLVERS)
    assert bench(*call, "--out", folder / "out") == 0
    SOLVERS.clear()
    SOLVERS.update(before)
    rows = {row.solver: row for row in read_results(folder / "out")}
    assert len(rows) == 3
    return rows


def test_loading_is_not_measured(in_a_second: dict[str, Measurement]) -> None:
    row = in_a_second["SLOW-AT-FIRST"]
    assert row.solved and row.seconds is not None and row.seconds < 1, row.status


def test_compiling_does_not_count_into_the_limit(in_a_second: dict[str, Measurement]) -> None:
    """Where numba's cache is cold and only the problem itself needs a kernel: 2.5 s within a limit of 1 s and its grace of another."""
    row = in_a_second["COMPILES"]
    assert row.solved and row.seconds is not None and row.seconds < 1, row.status


@pytest.mark.each_value
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("constrained", [False, True])
@pytest.mark.parametrize("storage", [sp.csc_array, sp.csr_array])
def test_methods_are_warmed_on_joints_as_large_problems_have_them(storage: type, constrained: bool, dimension: int) -> None:
    """In the form and storage of the problem; without constraints the joints are those that fronts are made of, and r = 0 is no answer."""
    d = dimension
    eye, G = storage(sp.eye_array(d)), storage(np.ones((d, 1))) if constrained else None
    like = GlobalProblem(eye, eye, np.zeros(d), -np.ones(d), np.ones(1), G, np.zeros(1) if constrained else None, d)
    chain = chain_like(like)
    assert isinstance(chain, GlobalProblem)
    assert type(chain.M) is type(chain.H) is storage and (chain.G is not None) == constrained and chain.dimension == d
    assert chain.m >= FRONTS_FROM
    local = reduce(chain).local
    if not constrained:
        assert joint_rows(sp.csr_array(local.W), d) is not None
    result = solve(chain, "auto", tol=1e-8)
    assert result.solved and result.iterations > 0
    given = chain_like(LocalProblem(storage(np.eye(d)), -np.ones(d), np.ones(1), dimension=d))
    assert isinstance(given, LocalProblem) and type(given.W) is storage
    if not constrained:
        assert abs(given.W - local.W).max() <= 1e-10 * abs(given.W).max()


def processes_in(folder: Path) -> list[int]:
    """Processes whose environment names the folder of this test."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if str(folder).encode() in path.read_bytes():
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="no /proc: processes left behind cannot be looked for")
@pytest.mark.parametrize(("jobs", "ending"), [(2, signal.SIGKILL), pytest.param(1, signal.SIGINT, marks=pytest.mark.slow)])
def test_a_bench_that_is_killed_goes_on(block: Path, plugin: Path, tmp_path: Path, jobs: int, ending: signal.Signals) -> None:
    write_fclib(block / "another.hdf5", sliding_block(0.2))
    out, notes = tmp_path / "out", tmp_path / "notes"
    tols = [10.0**-k for k in range(1, 5)]
    environment = os.environ | {"BENCH_NOTES": str(notes), "PYTHONPATH": str(ROOT)}
    command: list[str | Path] = [
        sys.executable,
        "-m",
        "fcsim",
        "bench",
        block,
        "--solvers",
        "EXACT",
        "--tols",
        ",".join(f"{tol:g}" for tol in tols),
    ]
    command += ["--time-limit", "60", "--jobs", str(jobs), "--plugin", plugin, "--out", out]
    # the tightest tolerance takes longer than is waited below for processes that outlive the bench
    (temporary := tmp_path / "temporary").mkdir()
    slow = environment | {"BENCH_LONG": "30", "TMPDIR": str(temporary)}
    with subprocess.Popen(
        command,
        env=slow,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as running:
        deadline = time.monotonic() + 300
        while not (out / "results.csv").exists() or (out / "results.csv").read_bytes().count(b"\n") < 1 + 3 * jobs:
            assert running.poll() is None and time.monotonic() < deadline, running.stdout and running.stdout.read()
            time.sleep(0.02)
        assert len(processes_in(tmp_path)) >= 1 + jobs  # the bench and its workers
        running.send_signal(ending)
        said = running.communicate()[0]
        assert running.returncode == (-signal.SIGKILL if ending == signal.SIGKILL else 130)
        assert ending == signal.SIGKILL or "the same command goes on with the rest" in said
    deadline = time.monotonic() + 300
    while processes_in(tmp_path):
        assert time.monotonic() < deadline, "processes outlive the bench"
        time.sleep(0.02)
    assert not list(temporary.glob("fcsim-*")), "workers leave files behind"
    finished = read_results(out)
    assert len(finished) == 3 * jobs
    if ending == signal.SIGINT:
        return
    with (out / "results.csv").open("ab") as file:  # as if killed within a line
        file.write(b"block,global,3,1,3,fcsim,EXACT,1e-")
    again = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300)
    assert again.returncode == 0, again.stderr
    rows = read_results(out)
    assert rows[: len(finished)] == finished
    assert {(row.problem, row.tol) for row in rows} == {(p.stem, tol) for p in block.glob("*.hdf5") for tol in tols}
    assert len(rows) == (out / "results.csv").read_bytes().count(b"\n") - 1 == 8  # none twice
    assert all(row.solved for row in rows)
    # each was measured once, those cut off twice
    assert 8 <= len(noted(notes)) <= 8 + jobs


def test_a_problem_that_cannot_be_read_does_not_end_the_bench(block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_fclib(block / "damaged.hdf5", sliding_block())
    import h5py

    with h5py.File(block / "damaged.hdf5", "r+") as file:
        file["fclib_global/M/nzmax"][...] = 1
    (block / "text.hdf5").write_text("no HDF5")  # seen before anything is measured, not when it is read as the other one
    eye = sp.eye_array(5, format="csc")
    write_fclib(block / "rolling.hdf5", GlobalRollingProblem(eye, eye, np.zeros(5), np.zeros(5), np.ones(1), np.ones(1)))
    out = tmp_path / "out"
    assert bench(block, "--solvers", "NSN-AC,NSGS-AC", "--tols", "1e-4", "--time-limit", 5, "--out", out) == 2
    told = capsys.readouterr()
    assert told.err.count("damaged.hdf5") == 1 and "/fclib_global/M/nzmax" in told.err
    assert told.err.count("text.hdf5") == 1 and len(re.findall(r"(damaged|text)\.hdf5 +unreadable", told.out)) == 2
    assert "rolling: left out, a rolling friction problem" in told.err
    assert "2 measurements made, 2 of 4" in told.out
    assert {(row.problem, row.solved) for row in read_results(out)} == {("block", True)}


def test_forms_are_told_from_the_files(block: Path) -> None:
    write_fclib(block / "here.hdf5", LocalProblem(np.eye(4), np.array([-1.0, 0, -1, 0]), np.array([0.3, 0.2]), dimension=2))
    (block / "below").mkdir()
    write_fclib(block / "below" / "block.hdf5", LocalProblem(np.eye(3) / 2, np.array([-5.0, 2.5, 0]), np.array([0.3])))
    expected = {
        "local": [("block", "local", 3, 1, 3), ("here", "local", 2, 2, 4)],
        "global": [("block", "global", 3, 1, 3)],
        "all": [("block", "global", 3, 1, 3), ("block", "local", 3, 1, 3), ("here", "local", 2, 2, 4)],
    }
    for form, problems in expected.items():
        found, notes = entries([block], form)
        assert sorted((e.name, e.form, e.dimension, e.nc, e.n) for e in found) == problems
        assert not notes
    assert [e.name for e in entries([block], dimension=2)[0]] == ["here"]
    assert {(e.name, e.form) for e in entries([block], dimension=3)[0]} == {("block", "global"), ("block", "local")}


def test_a_problem_without_an_answer_is_the_files_fault(tmp_path: Path) -> None:
    """Constraints given twice: each solver was recorded as CRASHED, its worker begun anew for each."""
    block = sliding_block()
    twice = GlobalProblem(block.M, block.H, block.f, block.w, block.mu, np.ones((3, 2)), np.ones(2))
    file = write_fclib(tmp_path / "twice.hdf5", twice)
    with pytest.raises(InputError, match=r"twice\.hdf5: its equations of motion cannot be solved: .* singular"):
        Worker(Settings(), tmp_path).problem(str(file))


def test_names_of_any_bytes_are_known_again(tmp_path: Path) -> None:
    """A name that is no UTF-8 ended a bench by a UnicodeEncodeError, one of two lines was measured again whenever the bench went on."""
    for name in ("caf\udce9.hdf5", "two\nlines.hdf5"):
        write_fclib(tmp_path / name, sliding_block())
    found = [entry.name for entry in entries([tmp_path])[0]]
    assert found == ["caf\\udce9", "two lines"]
    for name in found:
        request = Request(str(tmp_path), name, "global", 3, 1, 3, "NSGS", 1e-4, 1.0, None)
        append(tmp_path, blank(request, Settings(), "STAGNATED"))
    assert [row.problem for row in read_results(tmp_path)] == found


def test_bad_input_is_named(block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def refused(*arguments: Any) -> str:
        assert bench(*arguments, "--out", tmp_path / "out") == 2
        return capsys.readouterr().err

    assert "nowhere: expected a folder of FCLIB files" in refused(tmp_path / "nowhere")
    assert "in local form" in refused(block, "--form", "local")
    assert "FCLIB problems in 2D (*.hdf5)" in refused(block, "--dimension", "2")
    assert "--tols: expected numbers with commas between, got '1e-4;1e-6'" in refused(block, "--tols", "1e-4;1e-6")
    assert "--tols: expected a number > 0, got -1" in refused(block, "--tols=-1")
    assert "--time-limit: expected a number > 0" in refused(block, "--time-limit", 0)
    assert "solver 'NSN-XX': expected one of auto" in refused(block, "--solvers", "NSN-XX")
    assert "solver 'Siconos:NO': expected Siconos: and one of NSGS" in refused(block, "--solvers", "Siconos:NO")
    assert "expected the storage block or dense, got 'green'" in refused(block, "--siconos", "NSGS/green")
    assert "expected a Python that can import siconos" in refused(block, "--siconos", "NSGS", "--siconos-python", "/bin/false")
    assert "expected a Python file" in refused(block, "--plugin", tmp_path / "none.py")
    (tmp_path / "text.hdf5").write_text("no HDF5")
    assert "text.hdf5: expected an HDF5 file, got something else" in refused(block, tmp_path / "text.hdf5")  # named itself
    twin = tmp_path / "twin"
    twin.mkdir()
    write_fclib(twin / "block.hdf5", sliding_block())
    assert "is a global problem of the same" in refused(block, twin)
    assert not (tmp_path / "out").exists()


def test_a_table_of_other_problems_or_threads_is_refused(block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a b"
    call = [block, "--solvers", "NSN-AC", "--tols", "1e-4", "--out", out]
    assert bench(*call) == 0
    assert f"fcsim profile '{out}'" in capsys.readouterr().out  # can be copied
    assert bench(*call, "--threads", 2) == 2
    assert "measured with 1 threads, expected 2" in capsys.readouterr().err
    eye = sp.eye_array(4, 3, format="csc")
    write_fclib(block / "block.hdf5", GlobalProblem(sp.eye_array(4, format="csc"), eye, np.ones(4), np.zeros(3), np.ones(1)))
    assert bench(*call) == 2
    assert "its global problem block has other sizes than the file" in capsys.readouterr().err


def test_two_benches_do_not_write_one_table(block: Path, plugin: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import fcntl

    out = tmp_path / "out"
    out.mkdir()
    with (out / "results.csv").open("ab") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert bench(block, "--solvers", "NSN-AC", "--tols", "1e-4", "--out", out) == 2
    assert "another fcsim bench is writing there" in capsys.readouterr().err


def test_places_have_processors_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fcsim.bench.workers.launch.os.sched_getaffinity", lambda pid: {8, 2, 4, 6}, raising=False)
    assert [cores(place, 4, 1) for place in range(4)] == [(2,), (4,), (6,), (8,)]
    assert [cores(place, 2, 2) for place in range(2)] == [(2, 4), (6, 8)]
    assert sorted(cores(rank, 4, 1) for rank in range(1, 5)) == [(2,), (4,), (6,), (8,)]  # MPI: rank 0 does not measure
    assert cores(0, 5, 1) == cores(0, 2, 3) == ()


def test_measurements_are_pinned(in_a_second: dict[str, Measurement]) -> None:
    if not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2:
        pytest.skip("processors cannot be chosen here")
    assert in_a_second["LOOKS"].status == f"CRASHED: ArithmeticError: [{min(os.sched_getaffinity(0))}] 1"


@pytest.mark.parametrize("served", [["-m", "mpi4py.futures", "-m", "fcsim"], pytest.param(["-m", "fcsim"], marks=pytest.mark.slow)])
def test_over_mpi_ranks(block: Path, plugin: Path, tmp_path: Path, served: list[str]) -> None:
    mpiexec = Path(sys.executable).with_name("mpiexec")
    pytest.importorskip("mpi4py")
    if not mpiexec.exists():
        pytest.skip("no mpiexec beside this Python")
    out = tmp_path / "out"
    command: list[str | Path] = [
        mpiexec,
        "-n",
        "2",
        sys.executable,
        *served,
        "bench",
        block,
        "--launcher",
        "mpi",
        "--solvers",
        "NSN-AC,EXITS,LIES",
    ]
    command += ["--tols", "1e-2,1e-4", "--time-limit", "5", "--plugin", plugin, "--out", out]
    try:
        done = subprocess.run(
            command, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False, timeout=60, cwd=tmp_path
        )
    except subprocess.TimeoutExpired:
        pytest.skip("mpiexec does not start two ranks within a minute here")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("6 measurements made, 6 of 6") == 1
    assert {(row.solver, row.outcome) for row in read_results(out)} == {("NSN-AC", "SOLVED"), ("EXITS", "CRASHED"), ("LIES", "STAGNATED")}


def test_siconos_is_one_more_solver(block: Path, tmp_path: Path) -> None:
    version = siconos_version(SYSTEM_PYTHON)
    if version is None:
        pytest.skip(f"{SYSTEM_PYTHON} cannot import siconos.numerics")
    planar = LocalProblem(np.eye(2), np.array([-1.0, 0.1]), np.array([0.3]), dimension=2)
    write_fclib(block / "planar.hdf5", planar)
    out = tmp_path / "out"
    names = "NSGS,NSGS/dense,GLOBAL NSGS_WR,2D NSGS"
    call = [block, "--solvers", "NSN-AC", "--siconos", names, "--siconos-python", SYSTEM_PYTHON, "--tols", "1e-4,1e-10", "--out", out]
    assert bench(*call) == 0
    rows = read_results(out)
    theirs = {(row.problem, row.solver) for row in rows if row.program == "siconos"}
    assert theirs == {
        ("block", "Siconos:NSGS"),
        ("block", "Siconos:NSGS/dense"),
        ("block", "Siconos:GLOBAL NSGS_WR"),
        ("planar", "Siconos:2D NSGS"),
    }
    for row in rows:
        assert row.solved and row.error is not None and row.error <= 1.01 * row.tol and (row.seconds or 0) > 0
        assert row.version == version or row.program == "fcsim"
    assert set(SICONOS_BEST) <= set(CONFIGURATIONS)


def test_a_process_of_measurements_leaves_no_file_open() -> None:
    """Not even one that was started again: a thousand problems whose solver crashes would use up the files that a process may open."""
    worker = WorkerProcess(Settings(), ())
    first = worker._start()
    worker.end()
    second = worker._start()
    worker.end()
    pipes = (first.stdin, first.stdout, second.stdin, second.stdout)
    assert [pipe is not None and pipe.closed for pipe in pipes] == [True, True, False, False]
    worker.close()
    assert all(pipe is not None and pipe.closed for pipe in pipes)
