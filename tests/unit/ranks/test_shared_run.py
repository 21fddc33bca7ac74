"""`mpiexec -n N fcsim run`: one folder with what one process writes, one voice, one end."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fcsim.command_line.main import main
from fcsim.running.folder import open_run
from tests.unit.ranks.conftest import LAUNCHER, Ended, Program, end

PARAMETERS = ("--checkpoint-every", "2", "--export-every", "3", "--vtk-every", "6")
Rows = Callable[[Path], list[dict[str, str]]]


@pytest.fixture
def run(mpiexec: Program, tmp_path: Path) -> Callable[..., Ended]:
    """run(ranks, case, *arguments): fcsim run into tmp_path/out."""

    def start(ranks: int, case: Path, *arguments: str, **how: object) -> Ended:
        return mpiexec(ranks, "-m", "fcsim", "run", case, "--out", tmp_path / "out", *PARAMETERS, *arguments, **how)

    return start


def spoiled(case_folder: Path, line: str, rank: int = 1) -> Path:
    """The case with a gravity that does `line` on one rank once there is a checkpoint, the second step's, beside a file that says when."""
    script = case_folder / "two_blocks.py"
    text = script.read_text(encoding="utf-8")
    assert "gravity=lambda t: (2.0, 0, -9.81)," in text
    text = text.replace("gravity=lambda t: (2.0, 0, -9.81),", "gravity=gravity,").replace(
        "def build(p):",
        "import os\nRANK, SIGN = os.environ.get('PMI_RANK'), Path(__file__).parents[1] / 'out/checkpoint.h5'\n\n\n"
        f"def gravity(t):\n    if RANK == '{rank}' and SIGN.exists():\n"
        f"        SIGN.parents[1].joinpath('spoiled').touch()\n        {line}\n"
        "    return (2.0, 0, -9.81)\n\n\ndef build(p):",
    )
    script.write_text(text, encoding="utf-8")
    return case_folder


def seconds_since(spoiled: Path) -> float:
    """From what was done on one rank to now, by the clock of the files."""
    now = spoiled.with_name("now")
    now.touch()
    return now.stat().st_mtime - spoiled.stat().st_mtime


def whole(directory: Path) -> None:
    """Every file of a run that ended early can be read, and none is half there."""
    assert not list(directory.rglob("*.partial*"))
    open_run(directory)
    for path in [*directory.rglob("*.hdf5"), directory / "checkpoint.h5"]:
        with h5py.File(path) as file:
            assert len(file) > 0


@pytest.mark.slow
def test_a_run_over_ranks_writes_what_one_process_writes(
    run: Callable[..., Ended], case_folder: Path, tmp_path: Path, steps_without_seconds: Rows
) -> None:
    """And goes on with another number of them, bit by bit: 2, then 3, then 1."""
    assert main(["run", str(case_folder), "--out", str(tmp_path / "alone"), *PARAMETERS, "--quiet"]) == 0
    for ranks, steps in ((2, 5), (3, 9)):
        ended = run(ranks, case_folder, "--steps", str(steps), *(["--resume"] if ranks > 2 else []))
        assert ended.code == 0, ended.err
        assert ended.out.count("finished:") == 1 and "fcsim:" not in ended.err
        work = open_run(tmp_path / "out").description.ranks
        assert len(work) == ranks and all(rank.bytes > 0 for rank in work)
    assert main(["run", str(case_folder), "--out", str(tmp_path / "out"), *PARAMETERS, "--resume", "--steps", "12", "--quiet"]) == 0
    assert open_run(tmp_path / "out").description.ranks == ()
    assert steps_without_seconds(tmp_path / "out") == steps_without_seconds(tmp_path / "alone")
    exported = sorted(path.name for path in (tmp_path / "alone/fclib/global").iterdir())
    assert len(exported) == 4 and exported == sorted(path.name for path in (tmp_path / "out/fclib/global").iterdir())
    for name in exported:
        with h5py.File(tmp_path / "alone/fclib/global" / name) as one, h5py.File(tmp_path / "out/fclib/global" / name) as other:
            arrays: list[str] = []
            one.visititems(lambda place, entry, found=arrays: found.append(place) if isinstance(entry, h5py.Dataset) else None)
            assert arrays and all(
                np.array_equal(one[place][()], other[place][()]) for place in arrays if "info" not in place and "seconds" not in place
            )
    with h5py.File(tmp_path / "alone/checkpoint.h5") as one, h5py.File(tmp_path / "out/checkpoint.h5") as other:
        assert all(np.array_equal(one[name][()], other[name][()]) for name in ("x", "v"))


def test_a_law_with_a_function_runs_and_is_resumed_in_other_processes(run: Callable[..., Ended], case_folder: Path, tmp_path: Path) -> None:
    """A function shows where it is in memory, which is another place in each process."""
    script = case_folder / "two_blocks.py"
    text = script.read_text(encoding="utf-8").replace(
        "Theta(1e-3)", "Theta(1e-3, law=Gap(friction=lambda sliding: 0.3 + 0 * sliding.slip))"
    )
    assert "lambda sliding" in text
    script.write_text(text.replace("import numpy as np", "import numpy as np\nfrom fcsim import Gap", 1), encoding="utf-8")
    begun = run(2, case_folder, "--steps", "2")
    assert begun.code == 0, begun.err
    assert "lambda" in open_run(tmp_path / "out").description.scheme
    assert main(["run", str(case_folder), "--out", str(tmp_path / "out"), "--resume", "--steps", "3", "--quiet"]) == 0
    assert open_run(tmp_path / "out").description.steps_done == 3


def test_a_rank_that_raises_ends_all(run: Callable[..., Ended], case_folder: Path, tmp_path: Path) -> None:
    ended = run(2, spoiled(case_folder, "raise ZeroDivisionError('of this rank')"))
    assert ended.code != 0 and seconds_since(tmp_path / "spoiled") < 30
    assert re.search(r"fcsim: rank 1 of 2 has ended: .*ZeroDivisionError: of this rank", ended.err)
    assert re.search(r"two_blocks\.py, line \d+", ended.err) and "Traceback" not in ended.err  # the script's own function raises
    assert open_run(tmp_path / "out").description.status == "failed"
    assert "of this rank" in open_run(tmp_path / "out").description.message
    whole(tmp_path / "out")


@pytest.mark.slow
@pytest.mark.parametrize("how", ["SIGKILL", "SIGTERM"])
def test_a_rank_that_is_killed_ends_all(
    run: Callable[..., Ended], case_folder: Path, tmp_path: Path, how: str, steps_without_seconds: Rows
) -> None:
    """Killed outright or politely; and another number of ranks goes on."""
    script = case_folder / "two_blocks.py"
    innocent = script.read_text(encoding="utf-8")
    ended = run(3, spoiled(case_folder, f"import os, signal; os.kill(os.getpid(), signal.{how})"))
    assert ended.code != 0 and seconds_since(tmp_path / "spoiled") < 30
    whole(tmp_path / "out")
    assert open_run(tmp_path / "out").description.status == ("running" if how == "SIGKILL" else "interrupted")
    script.write_text(innocent, encoding="utf-8")
    assert main(["run", str(case_folder), "--out", str(tmp_path / "alone"), *PARAMETERS, "--quiet"]) == 0
    ended = run(2, case_folder, "--resume", "--accept-changes")
    assert ended.code == 0, ended.err
    assert steps_without_seconds(tmp_path / "out") == steps_without_seconds(tmp_path / "alone")


@pytest.mark.parametrize("rank", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_rank_that_is_stopped_is_named_and_waited_for(run: Callable[..., Ended], case_folder: Path, tmp_path: Path, rank: int) -> None:
    """The others waited for it, for ever perhaps, and nobody knew for what. It is woken once it is named."""
    once = "if not SIGN.parents[1].joinpath('once').exists(): SIGN.parents[1].joinpath('once').touch(); import signal, subprocess"
    wake = f"for k in $(seq 800); do [ -e {tmp_path}/named ] && break; sleep 0.1; done; kill -CONT "
    stop = f"subprocess.Popen(['sh', '-c', {wake!r} + str(os.getpid())]); os.kill(os.getpid(), signal.SIGSTOP)"
    script = spoiled(case_folder, f"{once}; {stop}", rank) / "two_blocks.py"
    names = f"lambda *words, **how: (print(*words, **how), Path({str(tmp_path)!r}, 'named').touch())"
    text = script.read_text(encoding="utf-8")
    text += f"\nworld = sys.modules['fcsim.ranks.world']\nworld.HELD, world.print = 1.0, {names}\n"
    script.write_text(text, encoding="utf-8")
    ended = run(2, case_folder)
    assert ended.code == 0, ended.err
    named = rf"fcsim: rank {rank} of 2 is stopped \(by SIGSTOP, or a debugger\), and the others wait for it: process \d+\n"
    assert len(re.findall(named, ended.err)) == ended.err.count("is stopped") == 1, ended.err
    assert open_run(tmp_path / "out").description.status == "finished"


KEEPER = """
import subprocess, sys, time
code = subprocess.run([sys.executable, *sys.argv[1:]], close_fds=False).returncode  # the launcher's socket among them
time.sleep(60 if code == -9 else 0)
sys.exit(code != 0)
"""


def test_a_rank_that_is_killed_is_missed_by_the_others(mpiexec: Program, case_folder: Path, tmp_path: Path) -> None:
    """Where a launcher does not see it, as here for a minute, they would wait for ever, and the folder would say that it is running."""
    killed, out = spoiled(case_folder, "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"), tmp_path / "out"
    keeper = tmp_path / "keeper.py"
    keeper.write_text(KEEPER, encoding="utf-8")
    ended = mpiexec(2, keeper, "-m", "fcsim", "run", killed, "--out", out, *PARAMETERS)
    assert ended.code != 0 and seconds_since(tmp_path / "spoiled") < 30
    assert "fcsim: rank 1 of 2 has ended: its process was killed, or crashed" in ended.err
    assert open_run(out).description.status == "failed"
    whole(out)


@pytest.mark.slow
def test_ranks_that_do_not_compute_the_same_are_told_so(run: Callable[..., Ended], case_folder: Path, tmp_path: Path) -> None:
    ended = run(2, spoiled(case_folder, "return (2.0, 0, -9.82)"))
    assert ended.code != 0 and re.search("step [34]: expected the same on every rank, rank 1 of 2 has another than rank 0", ended.err)
    assert open_run(tmp_path / "out").description.status == "failed"


@pytest.mark.slow
def test_models_without_a_seed(run: Callable[..., Ended], case_folder: Path, tmp_path: Path) -> None:
    script = case_folder / "two_blocks.py"
    text = script.read_text(encoding="utf-8").replace("np.array([0.03, ", "np.array([0.03 + 1e-3 * np.random.default_rng().random(), ")
    script.write_text(text, encoding="utf-8")
    ended = run(2, case_folder)
    assert ended.code == 2 and "expected the same on every rank" in ended.err and not (tmp_path / "out").exists()


@pytest.mark.slow
def test_bad_input_is_said_once(run: Callable[..., Ended], case_folder: Path) -> None:
    for arguments, message in ((["--set", "E=-1"], "E"), (["--set", "nonsense=1"], "nonsense"), (["--nonsense"], "nonsense")):
        ended = run(3, case_folder, *arguments)
        assert ended.code == 2 and len(re.findall(r"^(fcsim: |.*error: )", ended.err, re.MULTILINE)) == 1 and message in ended.err
        assert ended.err.count("usage: ") <= 1 and "usage: " not in ended.out


@pytest.mark.parametrize(
    ("command", "shown"), [(("solve", "x.hdf5"), "expected one process, got 2 ranks"), (("run", "--help"), "usage: fcsim run")]
)
def test_what_ends_before_any_rank_shares_is_said_once(mpiexec: Program, command: tuple[str, ...], shown: str) -> None:
    """Each rank refused, or helped, with its own voice."""
    ended = mpiexec(2, "-m", "fcsim", *command)
    assert ended.code == (0 if "--help" in command else 2) and (ended.out + ended.err).count(shown) == 1


@pytest.mark.slow
def test_ctrl_c_ends_all_and_says_so(case_folder: Path, tmp_path: Path) -> None:
    if not LAUNCHER.exists():
        pytest.skip("no mpiexec beside this Python")
    command = [LAUNCHER, "-n", "2", sys.executable, "-m", "fcsim", "run", case_folder, "--out", tmp_path / "out", "--set", "held=True"]
    (case_folder / "hold").touch()
    with subprocess.Popen(
        [str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as process:
        try:
            table = tmp_path / "out/steps.csv"
            for _ in range(1200):
                if table.exists() and len(table.read_text().splitlines()) > 7:
                    break
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
            out, _ = process.communicate(timeout=40)
        finally:
            end(process)
    assert "interrupted by the keyboard; go on with --resume" in out
    assert process.returncode != 0
    assert json.loads((tmp_path / "out/run.json").read_text())["status"] == "interrupted"
    whole(tmp_path / "out")


@pytest.mark.slow
def test_another_working_directory(mpiexec: Program, case_folder: Path, tmp_path: Path) -> None:
    """A relative folder, more ranks than bodies, sensors on rank 0 alone."""
    ended = mpiexec(
        4,
        "-m",
        "fcsim",
        "run",
        case_folder,
        "--steps",
        "2",
        "--json",
        cwd=tmp_path,
        env={"PYTHONPATH": os.fspath(Path(__file__).parents[3])},
    )
    assert ended.code == 0, ended.err
    assert json.loads(ended.out)["status"] == "finished" and (tmp_path / "results/two_blocks/run.json").is_file()
