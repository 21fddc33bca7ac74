"""Signals at any time of a command: before it is there to hear them, in all commands, once its answer is given."""

import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import fcsim.view
from fcsim.command_line.main import main


def _program(lines: str) -> subprocess.CompletedProcess[str]:
    """The installed program `fcsim cases`, after some lines of Python."""
    root = Path(__file__).parents[3]
    program = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]["fcsim"]
    begun = f"""
sys.argv = ["fcsim", "cases"]
from importlib.metadata import EntryPoint
raise SystemExit(EntryPoint("fcsim", {program!r}, "console_scripts").load()())
"""
    return subprocess.run([sys.executable, "-c", lines + begun], capture_output=True, text=True, cwd=root)


@pytest.mark.parametrize(
    ("loaded", "code", "said"),
    [("fcsim.command_line.main", 130, "fcsim: interrupted by the keyboard\n"), ("fcsim.moved", -signal.SIGINT, "")],
    ids=["command line", "package"],
)
def test_ctrl_c_while_the_program_is_loaded_is_no_traceback(loaded: str, code: int, said: str) -> None:
    """Loading the command line takes a second, the package before it a tenth: in both it was a traceback of imports."""
    ended = _program(f"""
import os, signal, sys
class Presses:
    def find_spec(self, name, *rest):
        if name == {loaded!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Presses())
""")
    assert (ended.returncode, ended.stdout, ended.stderr) == (code, "", said)


def test_ctrl_c_once_the_answer_is_given_ends_without_a_traceback() -> None:
    """While the reader of HDF5 files was ended, for half a second, it was one of an atexit callback."""
    ended = _program("""
import atexit, os, signal, sys
atexit.register(lambda: os.kill(os.getpid(), signal.SIGINT))
""")
    assert (ended.returncode, ended.stderr) == (-signal.SIGINT, "")
    assert "masonry_wall" in ended.stdout


@pytest.mark.parametrize(("number", "by"), [(signal.SIGTERM, "SIGTERM"), (signal.SIGINT, "the keyboard")])
def test_every_command_says_what_ended_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, number: signal.Signals, by: str
) -> None:
    """`fcsim render`, ended by SIGTERM as by batch systems, died without a word, its temporary files left."""
    monkeypatch.setattr(fcsim.view, "render", lambda *args, **options: signal.raise_signal(number))
    before = signal.signal(number, signal.SIG_IGN if number == signal.SIGTERM else signal.default_int_handler)
    try:
        assert main(["render", str(tmp_path)]) == 130
    finally:
        signal.signal(number, before)
    assert capsys.readouterr().err.endswith(f"fcsim: interrupted by {by}\n")
