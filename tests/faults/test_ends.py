"""Runs that end otherwise than they should: killed, signalled, on full disks, by two at once, under odd names.

What is left goes on and gives the run that was left alone, in every value.
"""

from __future__ import annotations

import csv
import faulthandler
import itertools
import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.interrupts import ended_politely
from fcsim.running.case import CaseScript, load_case
from fcsim.running.folder import open_run
from fcsim.running.run import RunOptions, run_case

CASES = Path(__file__).parents[2] / "cases"
RUNS: dict[str, tuple[dict[str, str], int]] = {
    "stack": ({"steps": "30"}, 30),
    "impact_bar": ({"steps": "40"}, 40),
    "masonry_wall": ({"steps": "25", "divisions": "2,1,1", "compression": "3000"}, 25),
}
OPTIONS = RunOptions(export_every=5, vtk_every=5, checkpoint_every=4)


def rows(out: Path) -> list[dict[str, str]]:
    """steps.csv without seconds, and without the overlaps, which are looked for at a run's end too."""
    with (out / "steps.csv").open(newline="", encoding="utf-8") as file:
        return [{k: v for k, v in row.items() if not k.startswith(("seconds", "overlap"))} for row in csv.DictReader(file)]


def left(out: Path) -> dict[str, Any]:
    """What a run leaves: its rows, the values of its checkpoint, of its FCLIB files, and the names of all its files."""
    found: dict[str, Any] = {"rows": rows(out)}
    for path in [out / "checkpoint.h5", *sorted(out.glob("fclib/**/*.hdf5"))]:
        with h5py.File(path) as file:
            values: dict[str, bytes] = {}
            file.visititems(lambda n, e, to=values: to.__setitem__(n, np.asarray(e[()]).tobytes()) if isinstance(e, h5py.Dataset) else None)  # type: ignore[misc]
        found[path.name] = {name: value for name, value in values.items() if not name.startswith("info")}
    found["names"] = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, tuple[CaseScript, dict[str, Any]]]:
    """Each case with what it leaves when nothing happens."""
    found = {}
    for name, (assignments, _) in RUNS.items():
        script, out = load_case(CASES / name), tmp_path_factory.mktemp(name) / "out"
        assert run_case(script, assignments, out, OPTIONS).status == "finished"
        found[name] = script, left(out)
    return found


SHORT = {"steps": "5"}
"""A checkpoint after four steps, an FCLIB file and VTK after five."""


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[CaseScript, dict[str, Any]]:
    """The stack with what five steps leave."""
    script, out = load_case(CASES / "stack"), tmp_path_factory.mktemp("short") / "out"
    assert run_case(script, SHORT, out, OPTIONS).status == "finished"
    return script, left(out)


def forked(script: CaseScript, assignments: Mapping[str, str], out: Path, options: RunOptions = OPTIONS, **how: bool) -> int:
    """Run or resume in a fork of this process; its number. Exit codes: 0 finished, 1 not, 2 refused, 3 OSError, 4 anything else."""
    child = os.fork()
    if child:
        return child
    code = 4
    try:
        faulthandler.disable()  # pytest's would print pages for the signals that are sent
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        with ended_politely():
            code = 0 if run_case(script, assignments, out, options, **how).converged else 1  # type: ignore[arg-type]
    except InputError:
        code = 2
    except OSError:
        code = 3
    finally:
        os._exit(code)


def await_rows(child: int, out: Path, count: int) -> None:
    """Return when the table has so many rows, or the child has ended."""
    table = out / "steps.csv"
    for _ in range(60_000):
        if (table.is_file() and table.read_bytes().count(b"\n") > count) or os.waitid(
            os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT
        ):
            return
        time.sleep(0.002)


def finished(script: CaseScript, assignments: Mapping[str, str], out: Path) -> dict[str, Any]:
    """Go on to the end, or begin where nothing had begun, and say what is left."""
    resume = (out / "run.json").is_file()
    assert run_case(script, assignments if not resume else {}, out, OPTIONS, resume=resume).status == "finished"
    return left(out)


def test_kills(whole: Any, tmp_path: Path, how_many: Any, generator: Any) -> None:
    """SIGKILL at any moment, some runs several times."""
    kills = how_many(6, 40)
    names = itertools.cycle(RUNS)
    count = 0
    while count < kills:
        name, out, random = next(names), tmp_path / f"out{count}", generator("kills", count)
        script, expected = whole[name]
        assignments, steps = RUNS[name]
        for _ in range(int(random.integers(1, 4))):
            resume = (out / "run.json").is_file()
            child = forked(script, {} if resume else assignments, out, resume=resume)
            await_rows(child, out, int(random.integers(0, steps)))
            time.sleep(float(random.uniform(0, 0.03)))
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            count += 1
        if out.is_dir() and (out / "run.json").is_file():
            json.loads((out / "run.json").read_text())
        assert finished(script, assignments, out) == expected, (name, count)
        shutil.rmtree(out)


ENDING = [s for s in signal.valid_signals() if s not in (signal.SIGKILL, signal.SIGSTOP, signal.SIGCHLD, signal.SIGCONT)]
LASTING = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU, signal.SIGURG, signal.SIGWINCH, signal.SIGPIPE, signal.SIGXFSZ)
"""Stop until SIGCONT, or are ignored by default or by fcsim (a reader that leaves)."""


def test_signals(whole: Any, tmp_path: Path, how_many: Any) -> None:
    """Every signal that a process can get, once in the middle of a run."""
    script, expected = whole["stack"]
    few = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE, signal.SIGSEGV, signal.SIGUSR1]
    every = [s for s in ENDING if s < signal.SIGRTMIN]
    for number in every if how_many(0, 1) else few:
        out = tmp_path / f"out{int(number)}"
        child = forked(script, RUNS["stack"][0], out)
        await_rows(child, out, 5)
        os.kill(child, number)
        if number in LASTING:
            os.kill(child, signal.SIGCONT)
        _, status = os.waitpid(child, 0)
        about = json.loads((out / "run.json").read_text())
        if number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            assert (about["status"] == "interrupted") == (os.WEXITSTATUS(status) == 1), number  # it may have ended just before
        elif number in LASTING:
            assert about["status"] == "finished", number
        assert finished(script, {}, out) == expected, number
        shutil.rmtree(out)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """A file system of so many KiB, or as many more where it is there."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = False

    def size(kib: int) -> Path:
        nonlocal mounted
        options = f"size={kib}k" + (",remount" if mounted else "")
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            pytest.skip(f"no small file system can be mounted here: {done.stderr.strip()}")
        mounted = True
        return place

    yield size
    if mounted:
        subprocess.run(["umount", str(place)], check=True)


def test_full_disks(whole: Any, tmp_path: Path, small_disk: Callable[[int], Path], how_many: Any) -> None:
    """Ten sizes, from none to nearly enough: no signal, a description that can be read, and the rest once there is room."""
    script, expected = whole["stack"]
    for kib in (4, 8, 16, 40, 100, 200, 300, 400, 600, 800)[:: 1 if how_many(0, 1) else 4]:
        place = small_disk(kib)
        out = place / "out"
        child = forked(script, RUNS["stack"][0], out)
        _, status = os.waitpid(child, 0)
        assert os.WIFEXITED(status) and os.WEXITSTATUS(status) in (0, 3), (kib, status)
        if (out / "run.json").is_file():
            about = json.loads((out / "run.json").read_text())
            assert about["status"] == ("finished" if os.WEXITSTATUS(status) == 0 else "failed"), kib
        small_disk(64_000)
        assert finished(script, RUNS["stack"][0], out) == expected, kib
        shutil.rmtree(out)


def test_two_writers(whole: Any, tmp_path: Path, how_many: Any) -> None:
    """Begun at the same time on one folder: one runs, the others are refused, whichever comes first."""
    script, expected = whole["stack"]
    for k in range(how_many(2, 10)):
        out = tmp_path / f"out{k}"
        children = [forked(script, RUNS["stack"][0], out, overwrite=True) for _ in range(3)]
        codes = sorted(os.WEXITSTATUS(os.waitpid(child, 0)[1]) for child in children)
        assert codes[0] == 0 and set(codes) <= {0, 2}, codes
        assert left(out) == expected


@pytest.mark.parametrize("every", [0, 1, 7, pytest.param(3, marks=pytest.mark.slow)])
def test_resume_matrix(whole: Any, tmp_path: Path, every: int, how_many: Any) -> None:
    """Interrupted after any step, whatever the checkpoints, and with the steps given only then."""
    script, expected = whole["stack"]
    options = RunOptions(export_every=5, vtk_every=5, checkpoint_every=every)
    for stop in range(1, 30) if how_many(0, 1) else (1, 6, 29):
        out = tmp_path / f"out{stop}"

        def leave(case: Any, step: Any, at: int = stop) -> None:
            if step.number == at:
                raise KeyboardInterrupt

        assert run_case(script, {"steps": "30"}, out, options, watch=leave).status == "interrupted"
        assert run_case(script, {}, out, options, resume=True).status == "finished"
        assert left(out) == expected, (every, stop)
        shutil.rmtree(out)


NAMES = (
    "with space",
    "-rf",
    "ä‖é",
    "100%s{0}",
    "a'b\"c",
    "$(touch x)",
    "a;b",
    "tab\tbell\x07",
    "line\nend",
    "n" * 200,
    "..a",
    "~",
)


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_hostile_names(short: tuple[CaseScript, dict[str, Any]], tmp_path: Path, name: str) -> None:
    """Folders of any name take a run; nothing is written beside."""
    script, expected = short
    assert "checkpoint.h5" in expected["names"] and any(path.startswith("fclib/") for path in expected["names"])
    inside = tmp_path / "inside"
    inside.mkdir()
    out = inside / name
    run_case(script, SHORT, out, OPTIONS)
    assert left(out) == expected and open_run(out).description.status == "finished"
    assert [entry.name for entry in tmp_path.iterdir()] == ["inside"] and len(list(inside.iterdir())) == 1


@pytest.mark.parametrize("make", ["loop", "file", "dangling", "too long", "no text"])
def test_places_that_are_none(whole: Any, tmp_path: Path, make: str) -> None:
    script, _ = whole["stack"]
    out = tmp_path / {"too long": "x" * 300, "no text": "\udcff"}.get(make, "out")
    if make == "loop":
        out.symlink_to(out)
    elif make == "file":
        out.write_text("mine")
    elif make == "dangling":
        out.symlink_to(tmp_path / "nowhere" / "there")
    with pytest.raises((InputError, OSError)):
        run_case(script, RUNS["stack"][0], out / "a" if make == "file" else out, OPTIONS)
    assert make != "file" or out.read_text() == "mine"
