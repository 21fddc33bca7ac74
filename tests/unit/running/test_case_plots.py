"""The scripts beside the cases that draw results against formulas: their tables, pictures, exit codes."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from runpy import run_path

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


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """run(script, *arguments): its exit code and what it says on both streams, called here."""

    def called(script: str, *arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", [script, *arguments])
        monkeypatch.syspath_prepend(str((CASES / script).parent))
        with pytest.raises(SystemExit) as left:
            run_path(str(CASES / script), run_name="__main__")
        said = capsys.readouterr()
        assert isinstance(left.value.code, int)
        return left.value.code, said.out, said.err

    return called


Called = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize("script", SCRIPTS)
def test_table_and_picture(run: Called, script: str, tmp_path: Path) -> None:
    arguments, count, picture = SCRIPTS[script]
    code, out, err = run(script, *arguments, "--out", str(tmp_path))
    assert code == 0, err
    header, rule, *rows, path = out.splitlines()
    assert set(rule) <= set("|-") and len(rows) == count
    assert all(row.count("|") == header.count("|") for row in rows)
    assert Path(path) == tmp_path / "plots" / picture
    assert Path(path).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("script", REFUSED)
def test_bad_arguments(run: Called, script: str, tmp_path: Path) -> None:
    arguments, message = REFUSED[script]
    code, _, err = run(script, *arguments, "--out", str(tmp_path))
    assert code == 2 and message in err and "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_as_a_program(tmp_path: Path) -> None:
    """In a process of its own: what it needs it loads itself, and nothing but its words is on the streams."""
    script, (arguments, message) = next(iter(REFUSED.items()))
    command = [sys.executable, str(CASES / script), *arguments, "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2 and message in done.stderr and not done.stdout
