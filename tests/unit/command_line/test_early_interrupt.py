"""Ctrl-C before the command line is there to hear it."""

import subprocess
import sys
import tomllib
from pathlib import Path


def test_ctrl_c_while_the_command_line_is_loaded_is_a_line() -> None:
    """Loading takes a second, in which it was a traceback."""
    at_the_import = """
import os, signal, sys
class Presses:
    def find_spec(self, name, *rest):
        if name == "fcsim.command_line.main":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Presses())
sys.argv = ["fcsim", "cases"]
from importlib.metadata import EntryPoint
raise SystemExit(EntryPoint("fcsim", PROGRAM, "console_scripts").load()())
"""
    root = Path(__file__).parents[3]
    program = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]["fcsim"]
    code = at_the_import.replace("PROGRAM", repr(program))
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=root)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "fcsim: interrupted by the keyboard\n")
