"""--json and --quiet of every command: one document, or nothing but errors."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest

from fcsim.command_line.answers import answering, table_of
from fcsim.command_line.main import _parser, main
from fcsim.command_line.progress import progress
from fcsim.command_line.terminal import print_table, say
from fcsim.errors import InputError
from fcsim.export_fclib import Solution, write_fclib
from fcsim.masonry import Block, MasonryProblem, write_masonry
from fcsim.mesh.solids.closed_surface import closed_surface
from fcsim.problem import Judge, LocalProblem
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters


def parsers(parser: argparse.ArgumentParser, path: str = "fcsim") -> list[tuple[str, argparse.ArgumentParser]]:
    below = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not below:
        return [(path, parser)]
    return [found for action in below for name, command in action.choices.items() for found in parsers(command, f"{path} {name}")]


def test_every_command_has_both() -> None:
    for path, parser in parsers(_parser()):
        options = {name for action in parser._actions for name in action.option_strings}
        assert {"--json", "--quiet"} <= options, path


def test_cells_that_are_numbers_are_numbers() -> None:
    table = table_of(("name", "n", "", "error"), [("a", "10", "x y", "1.5e-8"), ("b", "-", "", "inf")], "title")
    rows = [{"name": "a", "n": 10, "column 3": "x y", "error": 1.5e-8}, {"name": "b", "n": "-", "column 3": "", "error": "inf"}]
    assert table == {"title": "title", "rows": rows}


def test_lines_and_tables_are_kept(capsys: pytest.CaptureFixture[str]) -> None:
    with answering(quiet=False, as_json=True) as answer:
        say("a line")
        print_table(("a",), [("1",)])
        say("for people", to_stderr=True)
    assert answer.whole() == {"tables": [{"title": "", "rows": [{"a": 1}]}], "text": ["a line"]}
    assert capsys.readouterr() == ("", "for people\n")
    say("a line")
    assert capsys.readouterr().out == "a line\n"


def test_a_run_answers_in_json(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The summary's numbers are those of run.json and of the folder."""
    arguments = ["run", str(case_folder), "--out", str(tmp_path / "out"), "--export-every", "0", "--vtk-every", "0", "--steps", "3"]
    assert main([*arguments, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["command"] == "run" and answer["exit_code"] == 0
    assert (answer["status"], answer["steps"], answer["results"]) == ("finished", 3, str(tmp_path / "out"))
    assert 0 < answer["largest_error"] <= 1e-8 and answer["seconds"]["solve"] >= 0
    assert main([*arguments, "--json"]) == 2
    refused = json.loads(capsys.readouterr().out)
    assert refused["exit_code"] == 2 and "--overwrite" in refused["error"]


def test_a_quiet_run(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["run", str(case_folder), "--out", str(tmp_path / "out"), "--export-every", "0", "--vtk-every", "0", "--quiet"]
    assert main([*arguments, "--steps", "3"]) == 0
    assert capsys.readouterr() == ("", "")
    assert main([*arguments, "--overwrite", "--set", "max_iterations=1", "--set", "fallback=off"]) == 1
    said = capsys.readouterr()
    assert said.out == "" and said.err.startswith("not converged: ") and said.err.count("\n") == 1


def test_a_file_is_described_in_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`info --json` had lines for people alone, and `completion --json` was no JSON."""
    problem = LocalProblem(np.diag([2.0, 1.0, 1.0, 3.0, 1.0, 1.0]), np.array([-1.0, 0.3, 0.0, 1.0, 0.0, 0.0]), np.array([0.5, 0.25]))
    write_fclib(tmp_path / "a.hdf5", problem, solution=Solution(u=problem.q, r=(r := np.zeros(6))))
    assert main(["info", str(tmp_path / "a.hdf5"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    judge = Judge(problem)
    assert (told["form"], told["nc"], told["m"], told["dimension"], told["mu"]) == ("local", 2, 6, 3, [0.25, 0.5])
    assert told["matrices"]["W"]["shape"] == [6, 6] and told["matrices"]["W"]["nnz"] == 6
    assert told["solution"] == {"scaled_error": judge.scaled_error(r), "published_error": judge.error(r)} and told["guesses"] == 0
    assert main(["completion", "bash", "--json"]) == 0
    assert "fcsim" in json.loads(capsys.readouterr().out)["code"]


def test_a_model_is_described_in_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = [(x, y, z) for z in (0.0, 1.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))]
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    stone = Block(closed_surface("stone", points, faces), density=2000.0)
    ground = Block(closed_surface("ground", [(x, y, z - 1.0) for x, y, z in points], faces), support=True)
    write_masonry(tmp_path / "m.json", MasonryProblem("m", 3, (ground, stone), mu=0.7))
    assert main(["info", str(tmp_path / "m.json"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["blocks"], told["held"], told["dimension"], told["mu"]) == (1, ["ground"], 3, 0.7)
    assert told["mass [kg]"] == pytest.approx(2000.0) and told["volume [m^3]"] == pytest.approx(1.0)


def test_solvers_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solvers", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert {"NSN-AC", "NSGS-AC", "auto"} <= {entry["name"] for entry in answer["solvers"]} and "text" not in answer
    assert all(entry["dimensions"] and entry["source"] for entry in answer["solvers"])


def test_quiet_may_stand_before_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--quiet", "cases"]) == 0 and main(["cases", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_steps_with_a_bar(case_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = load_case(case_folder)
    simulation = script.build(parse_parameters(script, {"steps": "2"})).simulation
    assert [step.number for step in progress(simulation)] == [1, 2]
    assert "step 2 of 2: " in capsys.readouterr().err
    with pytest.raises(InputError, match=r"expected Simulation\(...\) itself"):
        next(progress([]))  # type: ignore[arg-type]


NOTEBOOK = """
from types import SimpleNamespace
from fcsim.command_line import terminal
from fcsim.command_line.progress import progress
class Simulation(list):
    steps = 2
def step(number):
    result = SimpleNamespace(error=1e-9)
    return SimpleNamespace(number=number, remarks=(), substeps=1, fell_back=False, contacts=(), iterations=1, result=result)
print([found.number for found in progress(Simulation([step(1), step(2)]))])
"""


@pytest.mark.slow
def test_a_bar_in_a_notebook() -> None:
    """A real kernel: the bar is a widget, and no line goes to the notebook's standard error."""
    pytest.importorskip("ipywidgets")
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(NOTEBOOK)])
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    outputs = notebook.cells[0].outputs
    assert any("application/vnd.jupyter.widget-view+json" in output.get("data", {}) for output in outputs)
    assert [output["text"] for output in outputs if output["output_type"] == "stream"] == ["[1, 2]\n"]


def test_a_run_of_no_steps_is_not_sent_to_be_drawn(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`render` refuses what has no step, and yet it was named as the next command."""
    arguments = ["run", str(case_folder), "--out", str(tmp_path / "out"), "--export-every", "0", "--vtk-every", "0"]
    assert main([*arguments, "--steps", "0"]) == 0
    assert "fcsim render" not in capsys.readouterr().out
    assert main(["render", str(tmp_path / "out")]) == 2
    assert "found nothing to draw" in capsys.readouterr().err
    assert main([*arguments, "--steps", "1", "--overwrite"]) == 0
    assert "fcsim render" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["solve", "limit", "shake", "info"])
def test_bad_input_is_answered_in_json(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of commands with a document of their own, too: standard output is JSON, whatever the end."""
    (tmp_path / "odd.json").write_text("{")
    assert main([command, str(tmp_path / "odd.json"), "--json"]) == 2
    said = capsys.readouterr()
    answer = json.loads(said.out)
    assert (answer["command"], answer["exit_code"]) == (command, 2)
    assert said.err == f"fcsim: {answer['error']}\n"
