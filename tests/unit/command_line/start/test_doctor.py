"""fcsim doctor: what it says where something is missing, and that each of its findings has a mend."""

import json
from importlib.util import find_spec

import pytest

from fcsim.command_line.main import main
from fcsim.command_line.start import findings


@pytest.mark.slow
def test_here_simulations_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["works"] and {"Python", "C compiler", "gmsh", "memory", "Siconos"} <= {entry["what"] for entry in answer["findings"]}
    assert all(entry["mend"] for entry in answer["findings"] if entry["state"] != "ok")


def test_a_machine_that_lacks_everything(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """No compiler, no packages, no libraries, nothing writable: each is said with what to do, and the exit code is 1."""
    monkeypatch.setattr(findings.shutil, "which", lambda name: None)
    monkeypatch.setattr(findings, "find_spec", lambda name: None)
    monkeypatch.setattr(findings.os, "access", lambda *of: False)
    assert main(["doctor", "--quiet"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    for words in ("apt-get install gcc libc6-dev", "pip install 'fcsim[fem]'", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        assert words in said.err
    assert main(["doctor"]) == 1
    assert "simulations do not work here" in capsys.readouterr().out


def test_libraries_that_gmsh_lacks_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(findings, "find_spec", lambda name: find_spec(name) if name == "gmsh" else None)
    monkeypatch.setattr(findings, "_tried", lambda script: (False, "OSError: libGLU.so.1"))
    monkeypatch.setattr(findings, "_loads", lambda library: library != "libGLU.so.1")
    gmsh = next(found for found in findings.finite_elements() if found.what == "gmsh")
    assert gmsh.state == "MISSING" and gmsh.mend == "Debian: apt-get install libglu1-mesa"
