"""The scripts beside the cases that draw results against formulas: their tables, pictures, exit codes."""

import subprocess
import sys
from pathlib import Path

import pytest

CASES = Path(__file__).parents[3] / "cases"
# arguments, rows of the table, picture
SCRIPTS = {
    "hertz/pressure.py": (
        ["--divisions", "3,6", "--set", "contact=cylinder", "--set", "approach=2.4e-4", "--set", "steps=6"],
        2,
        "pressure.png",
    ),
    "hertz/approach.py": (["--divisions", "2"], 4, "approach.png"),
    "cattaneo_mindlin/traction.py": (["--divisions", "4", "--set", "steps=6"], 1, "traction.png"),
}
REFUSED = {
    "hertz/pressure.py": (["--set", "contact=cube"], "expects one of sphere, cylinder, two-spheres"),
    "hertz/approach.py": (["--divisions", "0"], "divisions: expected a whole number >= 1, got 0"),
    "cattaneo_mindlin/traction.py": (["--divisions", "4,x"], "expected whole numbers separated by commas, got '4,x'"),
}


def run(script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, str(CASES / script), *arguments], capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("script", SCRIPTS)
def test_table_and_picture(script: str, tmp_path: Path) -> None:
    arguments, count, picture = SCRIPTS[script]
    done = run(script, *arguments, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    header, rule, *rows, path = done.stdout.splitlines()
    assert set(rule) <= set("|-") and len(rows) == count
    assert all(row.count("|") == header.count("|") for row in rows)
    assert Path(path) == tmp_path / "plots" / picture
    assert Path(path).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("script", REFUSED)
def test_bad_arguments(script: str, tmp_path: Path) -> None:
    arguments, message = REFUSED[script]
    done = run(script, *arguments, "--out", str(tmp_path))
    assert done.returncode == 2 and message in done.stderr and "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
