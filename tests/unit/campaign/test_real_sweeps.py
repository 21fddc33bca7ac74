"""fcsim sweep with real runs: killed and gone on with, by processes and by jobs."""

import csv
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SMALL = [
    f"--set={text}"
    for text in ("courses=2", "blocks=1.5", "divisions=2,1,1", "shear_start=0.005", "shear_full=0.01", "gravity_last=4", "beta=2e-3")
]
WALLS = [
    f"--over={text}" for text in ("compression=1e4,2e4,3e4", "friction=scripts,paper", "shear_velocity=-1e-3,-5e-4", "density=1500,2500")
]

pytestmark = pytest.mark.slow


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "fcsim", *map(str, arguments)]


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT)}


def table(out: Path) -> list[dict[str, str]]:
    with (out / "results.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def of_the_machine(name: str) -> bool:
    return name.startswith(("seconds", "peak"))


def lasting(rows: list[dict[str, str]]) -> list[dict[str, str]]:
    """Without what depends on the machine's speed, and the overlap: it is measured where a run ends, too."""
    return [{k: v for k, v in row.items() if not of_the_machine(k) and k != "largest_overlap"} for row in rows]


def until(condition: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    while not condition():
        assert process.poll() is None, "it has ended before"
        time.sleep(0.02)


def alive(out: Path) -> list[str]:
    """Command lines of processes that work for this sweep."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            text = (place / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            there = str((place / "cwd").readlink()) if "fcsim.campaign.worker" in text else ""
        except OSError:
            continue
        if there == str(out.parent):
            found.append(text)
    return found


@pytest.mark.timeout(1200)
def test_24_walls_over_two_processes_killed_and_resumed(tmp_path: Path) -> None:
    """The table is that of a sweep that nobody killed; what had finished is not made again."""
    out, steps = tmp_path / "killed", 60
    asked = command("sweep", ROOT / "cases/masonry_wall", *WALLS, *SMALL, "--steps", steps, "--jobs", 2, "--checkpoint-every", 5)
    for finished in (1, 9):  # killed in the first runs' first steps, and later
        process = subprocess.Popen([*asked, "--out", out], env=environment(), cwd=tmp_path, stderr=subprocess.DEVNULL)
        until(lambda finished=finished: len(list(out.glob("records/*.json"))) >= finished, process)
        until(lambda: bool(list(out.glob("runs/*/checkpoint.h5"))), process)
        process.send_signal(signal.SIGKILL)
        process.wait()
        deadline = time.monotonic() + 60
        while alive(out) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not alive(out)
    records = {path.name: path.stat().st_mtime_ns for path in out.glob("records/*.json")}
    done = subprocess.run([*asked, "--out", out], env=environment(), cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "24 of 24 finished" in done.stdout
    assert all((out / "records" / name).stat().st_mtime_ns == written for name, written in records.items())
    rows = table(out)
    assert len(rows) == 24 and {row["status"] for row in rows} == {"finished"} and {row["steps_done"] for row in rows} == {str(steps)}
    for row in rows:  # once the blocks rest, the bottom carries them: statics, W = rho g V, and the compression
        weight = float(row["density"]) * 9.81 * 2 * 1.5 * 0.2 * 0.1 * 0.1
        assert abs(float(row["bottom_Rz"]) - float(row["inertia_z"]) - weight - float(row["compression"])) < 1e-3 * float(
            row["compression"]
        )
    whole = tmp_path / "whole"
    subprocess.run([*asked, "--out", whole], env=environment(), cwd=tmp_path, capture_output=True, check=True)
    assert lasting(table(whole)) == lasting(rows)


def test_the_page_of_campaigns_says_what_its_example_gives(tmp_path: Path) -> None:
    """Statics (see the case): at 0.97 of the largest overhang bricks stand, at 1.03 they fall, however many they are."""
    page = (ROOT / "docs" / "campaigns.md").read_text(encoding="utf-8")
    (asked,) = re.findall(r"^    (fcsim sweep cases/stack .*)$", page, re.MULTILINE)
    out = tmp_path / "stack"
    words = asked.split()[1:]
    words[words.index("--out") + 1] = str(out)
    done = subprocess.run(command(*words), env=environment(), cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = table(out)
    assert [(row["bricks"], row["overhang"]) for row in rows] == [(b, o) for b in ("2", "4", "8") for o in ("0.97", "1.03")]
    for row in rows:
        assert (float(row["sinking"]) > 1e-3) == (row["overhang"] == "1.03")


def test_ctrl_c_ends_the_runs_with_their_checkpoints(tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = command("sweep", ROOT / "cases/masonry_wall", *SMALL, "--over=compression=1e4,2e4", "--steps", 400, "--jobs", 2, "--out", out)
    process = subprocess.Popen(asked, env=environment(), cwd=tmp_path, stderr=subprocess.DEVNULL)
    until(lambda: any(len(path.read_text(encoding="utf-8").splitlines()) > 3 for path in out.glob("runs/*/steps.csv")), process)
    process.send_signal(signal.SIGINT)
    assert process.wait() == 130
    assert not alive(out)
    assert {row["status"] for row in table(out)} == {"interrupted"}
    assert list(out.glob("runs/*/checkpoint.h5"))


@pytest.mark.parametrize("kill", [False, True])
def test_jobs_of_this_machine(tmp_path: Path, kill: bool) -> None:
    """Jobs outlive a sweep that is killed; the same command waits for them and makes nothing twice. One is above its limit there too."""
    pytest.importorskip("submitit", reason="jobs need submitit: pip install 'fcsim[cluster]'")
    out = tmp_path / "out"
    asked = command(
        "sweep", ROOT / "cases/masonry_wall", *SMALL, "--over=compression=1e4,2e4", "--steps", 30, "--jobs", 2, "--out", out,
        "--launcher", "jobs", "--time-limit", 300,
    )  # fmt: skip
    if kill:
        process = subprocess.Popen(asked, env=environment(), cwd=tmp_path, stderr=subprocess.DEVNULL)
        until(lambda: len(list(out.glob("runs/*/run.json"))) == 2, process)
        process.send_signal(signal.SIGKILL)
        process.wait()
    done = subprocess.run(asked, env=environment(), cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr + done.stdout
    assert {row["status"] for row in table(out)} == {"finished"}
    for path in out.glob("logs/*.txt"):
        assert path.read_text(encoding="utf-8").count("compression=") == 1  # begun once
