"""What reaches the terminal, and who may end a command."""

import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fcsim.command_line.assignments import checked_tolerance, positive, read_assignments
from fcsim.command_line.main import main
from fcsim.command_line.solve import solver_options
from fcsim.command_line.terminal import printable, table_lines
from fcsim.errors import InputError
from fcsim.running.folder import open_run

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("text", "shown"),
    [("\x1b[2J", "\\x1b[2J"), ("a\x07\x9b", "a\\x07\\x9b"), ("a\r\nb\tc", "a\\r\nb\tc"), ("‖Brémond‖", "‖Brémond‖"), ("\u202e", "\\u202e")],
)
def test_control_characters_are_shown(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_tables_are_aligned() -> None:
    lines = table_lines(("name", "n", "seconds"), [("a", "10", "1.5"), ("longer", "9", "10.25")])
    assert lines == ["name     n  seconds", "a       10      1.5", "longer   9    10.25"]


def fcsim(*arguments: str, shell: str = "", **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = " ".join([sys.executable, "-m", "fcsim", *arguments, shell])
    variables = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.run(["bash", "-c", command], env=variables, capture_output=True, timeout=120)


def test_ascii_terminals() -> None:
    done = fcsim("solvers", PYTHONIOENCODING="ascii", LC_ALL="C")
    assert done.returncode == 0 and done.stdout.isascii() and b"\\xe9" in done.stdout and done.stderr == b""


def test_a_reader_that_leaves_does_not_end_a_run(case_folder: Path, tmp_path: Path) -> None:
    """`fcsim run ... 2>&1 | head -1`: the run goes on to its end and says so in run.json."""
    out = tmp_path / "out"
    arguments = ["run", str(case_folder), "--out", str(out), "--export-every", "0", "--vtk-every", "0"]
    done = fcsim(*arguments, shell="2>&1 | head -1; exit ${PIPESTATUS[0]}")
    assert done.returncode == 0 and done.stdout.count(b"\n") == 1
    run = open_run(out)
    assert run.description.status == "finished" and len(run.columns["step"]) == 12


@pytest.mark.parametrize("options", [pytest.param("", marks=pytest.mark.slow), "--json"])
def test_an_answer_that_a_full_disk_does_not_take_is_no_success(options: str) -> None:
    """/dev/full takes nothing, as a full disk: what a script reads there afterwards is not the answer."""
    done = fcsim("cases", options, shell="> /dev/full")
    assert done.returncode == 2
    assert done.stderr.decode() == "fcsim: standard output: No space left on device; the answer there is not whole\n"


def test_a_terminal_that_is_closed_ends_a_run_and_is_said_to(case_folder: Path, tmp_path: Path) -> None:
    """The keyboard and SIGTERM: tests/unit/running/test_run.py, `test_signals`."""
    out = tmp_path / "out"
    (case_folder / "hold").touch()
    command = [sys.executable, "-m", "fcsim", "run", str(case_folder), "--out", str(out), "--set", "held=on", "--vtk-every", "0"]
    process = subprocess.Popen(
        command,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )
    try:
        deadline = time.monotonic() + 120
        while not ((out / "steps.csv").is_file() and (out / "steps.csv").read_text().count("\n") > 2) and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGHUP)
        output, _ = process.communicate(timeout=120)
    finally:
        process.kill()
    description = open_run(out).description
    assert process.returncode == 130, output
    by = "SIGHUP (the terminal was closed)"
    assert (description.status, description.message) == ("interrupted", f"interrupted by {by}; go on with --resume")


@pytest.mark.parametrize("text", ["flase", "2", "", "onn", "None"])
def test_misspelt_switches_do_not_change_the_method(text: str) -> None:
    with pytest.raises(InputError, match=f"--set safeguard={text}: solver NSN-AC expects on or off"):
        solver_options("NSN-AC", [f"safeguard={text}"])


def test_switches_and_numbers_are_read() -> None:
    assert solver_options("NSN-AC", ["safeguard=Off", "max_iterations=7"]) == {"safeguard": False, "max_iterations": 7}
    for text in ("max_iterations=1e20", "max_iterations=7.5", "max_iterations=nan"):
        with pytest.raises(InputError, match="expects a value of type int"):
            solver_options("NSN-AC", [text])


@pytest.mark.parametrize("tol", [1.0, 2.0, float("inf"), float("nan"), 0.0, -1.0])
def test_tolerances_are_below_one(tol: float) -> None:
    """From 1 on r = 0 would do."""
    with pytest.raises(InputError, match="--tol: expected a number between 0 and 1"):
        checked_tolerance(tol)


def test_numbers_above_zero() -> None:
    assert positive("--time-limit", float("inf"), infinite=True) == float("inf")
    for value in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="--time-limit: expected a number > 0"):
            positive("--time-limit", value)


def test_a_name_set_twice() -> None:
    assert read_assignments(["E=1", "E=1", "mu = 0.3"]) == {"E": "1", "mu": "0.3"}
    with pytest.raises(InputError, match="expected one value of E, got 1 before"):
        read_assignments(["E=1", "E=2"])


def test_errors_show_no_escapes(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    assert main(["info", str(tmp_path / "\x1b[31mred.hdf5")]) == 2
    said = capsys.readouterr().err
    assert "\x1b" not in said and "\\x1b[31mred" in said


@pytest.mark.parametrize("command", [["info", "a.hdf5"], ["collection", "check", "x"], ["bench", "x", "--out", "y"]])
def test_no_command_runs_as_ranks_of_mpi(command: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "4")
    assert main(command) == 2
    assert f"fcsim {command[0]}: expected one process, got 4 ranks" in capsys.readouterr().err


@pytest.mark.parametrize("closed", [*(pytest.param(one, marks=pytest.mark.slow) for one in ("<&-", ">&-", "2>&-")), "<&- >&- 2>&-"])
def test_streams_that_are_closed(case_folder: Path, tmp_path: Path, closed: str) -> None:
    """A run ended in an AttributeError of None, and result files took the numbers of the streams, into which libraries print."""
    arguments = ["run", str(case_folder), "--out", str(tmp_path / "out"), "--steps", "1", "--export-every", "0", "--vtk-every", "0"]
    done = fcsim(*arguments, shell=closed)
    assert done.returncode == 0 and open_run(tmp_path / "out").description.status == "finished"


def test_bad_input_is_one_line_whatever_the_file_is_called(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a\nb\x1b[2J.hdf5"
    path.write_text("x")
    for given in (path, tmp_path / "no\nsuch"):
        assert main(["info", str(given)]) == 2
        said = capsys.readouterr().err
        assert said.startswith("fcsim: ") and said.count("\n") == 1 and "\x1b" not in said


LEAVING = {
    "as it is loaded": ("@dataclass(frozen=True)", "import sys; sys.exit(0)\n\n@dataclass(frozen=True)"),
    "as it is built": ("    part = brick(", "    raise SystemExit(0)\n    part = brick("),
}


@pytest.mark.parametrize("when", LEAVING)
def test_a_script_that_leaves_is_no_success(case_folder: Path, tmp_path: Path, when: str, capsys: pytest.CaptureFixture[str]) -> None:
    """sys.exit(0) of a case script ended `fcsim run` with exit code 0 and nothing done."""
    script = case_folder / "two_blocks.py"
    text = script.read_text()
    assert LEAVING[when][0] in text
    script.write_text(text.replace(*LEAVING[when], 1))
    assert main(["run", str(case_folder), "--out", str(tmp_path / "out")]) == 2
    assert "ends the program (0)" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_working_directory_that_is_gone_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was "[Errno 2] No such file or directory", of no file."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    (tmp_path / "here").rmdir()
    assert main(["run", "stack"]) == 2
    assert capsys.readouterr().err == "fcsim: the working directory is no longer there: go to another folder\n"
