"""Runs of a sweep whose script fails: what would come again stays as it is, and the machine's faults are tried again."""

from pathlib import Path

import pytest

from fcsim.command_line.main import main

SCRIPT = """
import os
import subprocess
from dataclasses import dataclass


@dataclass(frozen=True)
class Parameters:
    mu: float = 0.5


def build(p):
    FAULT
"""
STAYS = {
    "assert p.mu < 0.1, 'too rough'": "line 13: assert p.mu < 0.1, 'too rough': AssertionError: too rough",
    "subprocess.run(['false'], check=True)": "CalledProcessError: Command '['false']' returned non-zero exit status 1.",
    "open('missing.csv')": "FileNotFoundError: [Errno 2] No such file or directory: 'missing.csv'",
}
AGAIN = {
    "raise OSError(28, 'No space left on device')": "crashed: OSError: [Errno 28] No space left on device",
    "os.kill(os.getpid(), 9)": "crashed: its process ended without a word, signal 9 (SIGKILL)",
}


REPEATED = ["assert p.mu < 0.1, 'too rough'", "subprocess.run(['false'], check=True)"]
"""Slow: they stay for the reason for which a missing file does, which of all errors of the system is no fault of the machine."""


@pytest.mark.parametrize(
    ("fault", "said"),
    [pytest.param(*pair, marks=pytest.mark.slow if pair[0] in REPEATED else ()) for pair in [*STAYS.items(), *AGAIN.items()]],
)
def test_what_the_script_does_stands_and_what_the_machine_does_is_tried_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str, said: str
) -> None:
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "tiny.py").write_text(SCRIPT.replace("FAULT", fault), encoding="utf-8")
    command = ["sweep", str(tmp_path / "tiny"), "--over", "mu=0.3", "--jobs", "1", "--out", str(tmp_path / "out")]
    stays = fault in STAYS

    def begun() -> int:
        """How often a process has begun with the run, by its log; the end of the sweep is checked."""
        assert main(command) == 1
        told = capsys.readouterr().out
        assert said in told and ("mu=0.3: refused" in told) == stays
        assert ("1 of these stays so when the same command is given again; --retry makes them anew" in told) == stays
        return next((tmp_path / "out/logs").glob("*.txt")).read_text().count(", 20")  # a date

    assert [begun(), begun()] == ([1, 1] if stays else [1, 2])
    if stays:  # what is tried again at any rate needs no --retry
        command.append("--retry")
        assert begun() == 2
