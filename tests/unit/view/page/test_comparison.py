"""Runs side by side: what differs is said, numbers are those of steps.csv, curves are each run's own."""

import json
import re
import shutil

import numpy as np
import pytest

from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.running.folder import open_run
from fcsim.view.page.comparison import compare, write_comparison


@pytest.fixture
def two(run_directory, tmp_path):
    """A run, and another one of the same name in another folder with a parameter changed and all reactions doubled."""
    folders = [tmp_path / "a" / "run", tmp_path / "b" / "run"]
    for folder in folders:
        shutil.copytree(run_directory, folder, ignore=shutil.ignore_patterns("vtk"))
    about = json.loads((folders[1] / "run.json").read_text())
    about["parameters"] = {**about["parameters"], "mu": 0.25}
    (folders[1] / "run.json").write_text(json.dumps(about))
    run = open_run(folders[1])
    columns = {entry.column for entry in run.plots.reaction}
    header, *rows = [line.split(",") for line in (folders[1] / "steps.csv").read_text().splitlines()]
    for row in rows:
        for k, name in enumerate(header):
            if name in columns:
                row[k] = repr(2 * float(row[k]))
    (folders[1] / "steps.csv").write_text("\n".join(",".join(row) for row in [header, *rows]) + "\n")
    return folders


def test_what_differs_is_said_and_numbers_are_those_of_the_tables(two):
    compared = compare([open_run(folder) for folder in two])
    assert compared.names == ("a/run", "b/run")
    assert [(what, values[1]) for what, values in compared.differences] == [("mu", "0.25")]
    numbers = dict(compared.numbers)
    entry = compared.runs[0].plots.reaction[0]
    values = compared.runs[0].numbers(entry.column)
    said = [float(text.split()[0]) for text in numbers[f"{entry.label}, last"]]
    assert said[1] == pytest.approx(2 * said[0], rel=1e-4)
    assert abs(said[0]) == pytest.approx(abs(values[-1]) / {"kN": 1e3, "N": 1.0}[numbers[f"{entry.label}, last"][0].split()[1]], rel=1e-4)


def test_the_page_has_the_curves_of_both(two, tmp_path):
    runs = [open_run(folder) for folder in two]
    text = write_comparison(compare(runs), tmp_path / "new" / "c.html").read_text(encoding="utf-8")
    content = json.loads(re.search(r'id="content">(.*?)</script>', text, re.DOTALL).group(1))
    graph = next(graph for graph in content["graphs"] if graph["title"] == "Reactions")
    first, second = (next(curve for curve in graph["curves"] if curve["run"] == number) for number in (0, 1))
    np.testing.assert_allclose(second["y"], 2 * np.array(first["y"]), rtol=1e-9)
    assert "default-src 'none'" in text and "0.25" in text


def test_the_command_shows_both_and_refuses_one_or_the_same_twice(two, capsys):
    assert main(["compare", *map(str, two)]) == 0
    said = capsys.readouterr().out
    assert "a/run" in said and "b/run" in said and "0.25" in said
    assert main(["compare", str(two[0])]) == 2
    assert "two runs or more" in capsys.readouterr().err
    assert main(["compare", str(two[0]), str(two[0])]) == 2
    assert "twice" in capsys.readouterr().err


def test_equal_runs_differ_in_nothing(two, run_directory):
    assert compare([open_run(two[0]), open_run(run_directory)]).differences == ()
    with pytest.raises(InputError, match="two runs or more"):
        compare([])
