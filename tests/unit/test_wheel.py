"""The wheel: what is in it, and (slow) that it works in an empty environment."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_wheel_works_in_an_empty_environment(tmp_path: Path) -> None:
    """`make wheel`: built, checked, installed with [all], doctor, cases, a run by name, a new case, completion."""
    trial = tmp_path / "trial"
    environment = {**os.environ, "PYTHON": sys.executable, "FCSIM_WHEEL_TRIAL": str(trial)}
    reachable = subprocess.run(
        [sys.executable, "-m", "pip", "download", "--no-deps", "-q", "-d", str(tmp_path), "build"],
        capture_output=True,
        text=True,
        check=False,
    )
    if reachable.returncode:
        pytest.skip(f"pip cannot download packages here: {reachable.stderr.strip().splitlines()[-1:]}")
    done = subprocess.run([ROOT / "tools" / "wheel.sh"], env=environment, capture_output=True, text=True, timeout=3000, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "works in an empty environment" in done.stdout
    (wheel,) = (ROOT / "dist").glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    cases = [path for path in (ROOT / "cases").rglob("*.py")]
    assert all(f"fcsim/cases/{path.relative_to(ROOT / 'cases')}" in names for path in cases)
    assert "fcsim/py.typed" in names and "fcsim/command_line/start/template.py" in names
    assert not [name for name in names if name.endswith(".png") or name.startswith(("tests/", "cases/"))]
