"""fcsim leaderboard: problems, measurements and page by one command, which goes on where it was and says what is absent."""

import json
import re
import shlex
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.bench.families import FAMILIES
from fcsim.bench.results import read_results
from fcsim.bench.workers.siconos_client import siconos_version
from fcsim.command_line.main import main
from fcsim.command_line.sets.leaderboard import SOLVERS as DEFAULT
from fcsim.command_line.sets.measuring import SICONOS_PYTHON
from fcsim.export_fclib import write_fclib
from fcsim.problem import LocalProblem
from fcsim.solvers import method

NO_SICONOS = Path("/bin/false")


class Page(HTMLParser):
    """Collects the text, the anchors and what would be loaded, and checks that elements close in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.sources: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag not in ("meta", "img"):
            self.open.append(tag)
        self.ids += [given["id"] or ""] if "id" in given else []
        self.links += [given["href"] or ""] if "href" in given else []
        self.sources += [given["src"] or ""] if "src" in given else []

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Two FCLIB files of one contact that sticks, r = -q; and one in the plane."""
    folder = tmp_path / "mine"
    folder.mkdir()
    for number, push in enumerate((0.1, 0.2)):
        write_fclib(folder / f"sticks-{number}.hdf5", LocalProblem(np.eye(3), np.array([-1.0, push, 0.0]), np.array([0.5])))
    write_fclib(folder / "flat.hdf5", LocalProblem(np.eye(2), np.array([-1.0, 0.1]), np.array([0.5]), dimension=2))
    return folder


def leaderboard(*arguments: Any) -> int:
    return main(["leaderboard", *map(str, arguments)])


def test_one_command_makes_the_page_and_goes_on(files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "board"
    base = [folder, "--fclib", files, "--families", "rods", "--sizes", 2, "--seeds", 0, "--time-limit", 30, "--clock", "cpu"]
    base += ["--siconos-python", NO_SICONOS]
    assert leaderboard(*base, "--solvers", "auto", "--json") == 0
    out, err = capsys.readouterr()
    begun, told = "fcsim leaderboard: 4 problems x 1 solvers x 1 tolerances, up to 4 solves of at most 30 s, 0:02:00", json.loads(out)
    assert begun in err and str(folder) in err  # before anything is measured
    assert any("4 measurements made, 4 of 4" in line for line in told["text"])
    first = read_results(folder)
    assert {(m.problem, m.outcome) for m in first} == {
        ("sticks-0", "SOLVED"), ("sticks-1", "SOLVED"), ("flat", "SOLVED"), ("rods-2-0", "INFEASIBLE")
    }  # fmt: skip
    tables = {table["title"].partition(":")[0]: table["rows"] for table in told["tables"]}
    assert tables["rods, 2D"][0]["says infeasible"] == "1 of 1"
    assert tables["FCLIB mine, 3D"][0]["solved"] == "2 of 2" and tables["FCLIB mine, 2D"][0]["solved"] == "1 of 1"

    # another solver: what is there is not measured again
    assert leaderboard(*base, "--solvers", "auto,NSGS-AC") == 0
    out = capsys.readouterr()
    assert "4 measurements made, 8 of 8" in out.out and "Siconos is absent: /bin/false cannot import siconos.numerics." in out.err
    assert read_results(folder)[: len(first)] == first
    text = (folder / "leaderboard.html").read_text(encoding="utf-8")
    page = Page(text)
    words = " ".join(page.words)
    assert all(source.startswith("data:") for source in page.sources)
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)
    assert "Siconos is absent" in words and "no Siconos" in words and "numba" in words and "processor time" in words
    assert text.count("<img") == 1  # the profile of the two files in 3D; one problem has none
    for name, rows in (("FCLIB mine, 3D: 2 problems of 1 contact", 2), ("rods, 2D: 1 problem of 2 contacts", 2)):
        body = re.search(rf"{re.escape(name)}</h3>.*?<tbody>(.*?)</tbody>", text, re.DOTALL)
        assert body is not None and body[1].count("<tr>") == rows
    assert "Every solver solved every problem that has a solution." in words

    # the command on the page is one that has nothing left to do
    command = json.loads((folder / "bench.json").read_text(encoding="utf-8"))["command"]
    assert command in words and command in (folder / "leaderboard.md").read_text(encoding="utf-8")
    before = (folder / "results.csv").read_bytes()
    assert main(shlex.split(command)[1:]) == 0
    assert "0 measurements made, 8 of 8" in capsys.readouterr().out and (folder / "results.csv").read_bytes() == before
    assert json.loads((folder / "bench.json").read_text(encoding="utf-8"))["command"] == command


@pytest.mark.skipif(siconos_version(SICONOS_PYTHON) is None, reason=f"{SICONOS_PYTHON} has no siconos.numerics")
def test_siconos_is_measured_where_it_is(files: Path, tmp_path: Path) -> None:
    folder = tmp_path / "board"
    base = [folder, "--fclib", files / "sticks-0.hdf5", "--families", "none", "--solvers", "NSGS-AC", "--time-limit", 30]
    assert leaderboard(*base) == 0
    rows = {m.solver: m for m in read_results(folder)}
    assert {"NSGS-AC", "Siconos:NSGS", "Siconos:ADMM"} <= set(rows) and rows["Siconos:NSGS"].solved
    assert f"Siconos {rows['Siconos:NSGS'].version}" in (folder / "leaderboard.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_by_jobs_of_submitit(tmp_path: Path) -> None:
    pytest.importorskip("submitit", reason="jobs need submitit: pip install 'fcsim[cluster]'")
    small = ["--families", "rods", "--sizes", 2, "--seeds", 0, "--solvers", "auto", "--siconos", "none", "--time-limit", 30]
    assert leaderboard(tmp_path, *small, "--launcher", "jobs", "--jobs", 2) == 0
    assert [(m.problem, m.outcome) for m in read_results(tmp_path)] == [("rods-2-0", "INFEASIBLE")]
    assert "--jobs 2 --launcher jobs" in (tmp_path / "leaderboard.md").read_text(encoding="utf-8")


def test_the_defaults_are_there() -> None:
    assert len([method(name) for name in DEFAULT.split(",")]) == 12
    assert {False, None, True} == {family.solvable for family in FAMILIES.values()}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--families", "none"], "--families none: expected --fclib DIR beside it"),
        (["--families", "cubes"], "family 'cubes': expected one of spheres"),
        (["--sizes", "ten"], "--sizes: expected whole numbers with commas between, got 'ten'"),
        (["--sizes", ","], "--sizes: expected at least one whole number"),
        (["--sizes", "0"], "--sizes: expected numbers of contacts from 1 to"),
        (["--seeds=-1"], "--seeds: expected integers >= 0, got -1"),
        (["--solvers", "NSN-XX"], "solver 'NSN-XX': expected one of auto"),
        (["--fclib", "nowhere"], "nowhere: expected a folder of FCLIB files"),
        (["--siconos", "NSGS", "--siconos-python", NO_SICONOS], "expected a Python that can import siconos"),
        (["--tols", "2"], "--tols: expected numbers < 1"),
        (["--time-limit", 0], "--time-limit: expected a number > 0"),
    ],
)
def test_bad_input_is_named(arguments: list[Any], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "board"
    small = ["--families", "rods", "--sizes", 2, "--seeds", 0, "--solvers", "NSGS-AC", "--siconos-python", NO_SICONOS]
    assert leaderboard(folder, *small, *arguments) == 2
    assert said in capsys.readouterr().err
    assert not (folder / "results.csv").exists() and not list(tmp_path.rglob("*.hdf5"))
    assert not folder.exists() or arguments[0] in ("--siconos", "--tols"), "nothing is left of what was refused"


def test_a_folder_of_files_is_not_taken_for_the_leaderboard(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(files.iterdir())
    assert leaderboard(files, "--families", "rods", "--sizes", 2, "--seeds", 0) == 2
    assert "--fclib" in capsys.readouterr().err and sorted(files.iterdir()) == before


@pytest.mark.parametrize("name", [".hidden", "problems/mine.hdf5", "bench.json"])
def test_nor_one_of_other_things(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Files whose names begin with a dot, a folder of problems of one's own, the results of fcsim bench."""
    folder = tmp_path / "board"
    (folder / name).parent.mkdir(parents=True)
    (folder / name).write_text(json.dumps({"command": "fcsim bench mine --out board"}))
    assert leaderboard(folder, "--families", "rods", "--sizes", 2, "--seeds", 0, "--solvers", "NSGS-AC") == 2
    said = capsys.readouterr().err
    found = "a bench (fcsim bench mine --out board)" if name == "bench.json" else f"other files ({name.partition('/')[0]})"
    assert "expected a folder for the leaderboard, a new one or its own, found " + found in said
    assert [path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()] == [name]


def test_a_file_is_no_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "board").write_text("")
    assert leaderboard(tmp_path / "board", "--families", "rods", "--sizes", 2, "--seeds", 0) == 2
    assert "found a file" in capsys.readouterr().err
