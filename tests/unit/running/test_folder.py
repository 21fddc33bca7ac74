"""A run's folder read back: tables, series, and what is no run."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fcsim.errors import InputError
from fcsim.running.description import Description, write_description
from fcsim.running.folder import Instant, open_run, read_columns
from fcsim.running.series.collection import Entry, read_collection, write_collection

TABLE = "step,t,error,status\n1,0.1,1e-9,SOLVED\n2,0.2,,SOLVED\n3,0.3,2e-9,STAGNATED\n"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / "out"
    folder.mkdir()
    write_description(folder, Description(case="two", title="Two blocks", status="finished"))
    (folder / "steps.csv").write_text(TABLE)
    return folder


def series(folder: Path, **entries: list[tuple[float, str]]) -> None:
    (folder / "vtk").mkdir()
    for name, listed in entries.items():
        write_collection(folder / "vtk" / f"{name}.pvd", [Entry(*entry, name) for entry in listed])
        for _, file in listed:
            (folder / "vtk" / file).write_text("x")


def test_collections_come_back(tmp_path: Path) -> None:
    entries = [Entry(0.1, "a & b.vtu", "blocks"), Entry(1 / 3, "b.vtp", "contacts"), Entry(-2e-300, "c.vtu", "mine")]
    write_collection(tmp_path / "c.pvd", entries)
    assert read_collection(tmp_path / "c.pvd") == entries
    text = (tmp_path / "c.pvd").read_text()
    assert text.startswith("<?xml") and 'type="Collection"' in text and 'byte_order="LittleEndian"' in text and 'version="0.1"' in text
    assert text.count('group=""') == 3 and text.count('part="0"') == 2 and 'part="1" name="contacts"' in text and text.count("\n") >= 5
    write_collection(tmp_path / "c.pvd", [])
    assert read_collection(tmp_path / "c.pvd") == []
    assert [path.name for path in tmp_path.iterdir()] == ["c.pvd"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<VTKFile>",
        '<VTKFile><Collection><DataSet file="a"/></Collection></VTKFile>',
        '<VTKFile><Collection><DataSet timestep="1"/></Collection></VTKFile>',
        '<VTKFile><Collection><DataSet timestep="x" file="a"/></Collection></VTKFile>',
        '<VTKFile><Collection><DataSet timestep="nan" file="a"/></Collection></VTKFile>',
        '<VTKFile><Collection><DataSet timestep="1" file="a"/><DataSet timestep="inf" file="a"/></Collection></VTKFile>',
        '<?xml version="1.0" encoding="no-such"?><VTKFile/>',
    ],
)
def test_what_is_no_collection(tmp_path: Path, text: str) -> None:
    (tmp_path / "c.pvd").write_text(text)
    with pytest.raises(InputError, match=r"c\.pvd: expected a ParaView collection \(\.pvd\) with a time and a file in each entry"):
        read_collection(tmp_path / "c.pvd")


def test_a_run_is_opened(run: Path) -> None:
    opened = open_run(str(run))
    assert opened.directory == run and opened.instants == ()
    assert list(opened.columns) == ["step", "t", "error", "status"]
    assert_array_equal(opened.columns["error"], [1e-9, np.nan, 2e-9])
    assert opened.columns["status"].tolist() == ["SOLVED", "SOLVED", "STAGNATED"]
    assert opened.plots == opened.description.plots and opened.description.status == "finished"


def test_titles(run: Path) -> None:
    assert open_run(run).title == "Two blocks"
    write_description(run, Description(case="two", status="finished"))
    assert open_run(run).title == "two"
    write_description(run, Description(status="finished"))
    assert open_run(run).title == "out"


def test_numbers_of_columns(run: Path) -> None:
    opened = open_run(run)
    times = opened.numbers("t")
    assert times is not None
    assert_array_equal(times, [0.1, 0.2, 0.3])
    assert opened.numbers("status") is None and opened.numbers("no such") is None
    (run / "steps.csv").write_text("step,t\n")
    assert open_run(run).numbers("t") is None


@pytest.mark.parametrize(("t", "step"), [(-1.0, 1), (0.14, 1), (0.16, 2), (0.2, 2), (0.26, 3), (9.0, 3)])
def test_values_at_a_time(run: Path, t: float, step: int) -> None:
    opened = open_run(run)
    assert opened.at("step", t) == step and isinstance(opened.at("step", t), float)
    assert opened.at("status", t) is None and opened.at("no such", t) is None
    (run / "steps.csv").write_text("step,error\n1,1e-9\n")
    assert open_run(run).at("step", t) is None


def test_rows_that_are_cut(tmp_path: Path) -> None:
    (tmp_path / "steps.csv").write_text("a,b\n1,2\n3\n4,5,6\n7,x\n8,")
    columns = read_columns(tmp_path / "steps.csv")
    assert_array_equal(columns["a"], [1, 7, 8])
    assert columns["b"].tolist() == ["2", "x", ""]
    (tmp_path / "steps.csv").write_text("a,b\n1,\n2,3\n")
    columns = read_columns(tmp_path / "steps.csv")
    assert math.isnan(columns["b"][0]) and columns["b"][1] == 3 and columns["b"].dtype == np.float64


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "expected a header with the names of the columns, got an empty file"),
        ("a,b,a\n1,2,3\n", "expected different names of the columns, got a,"),
    ],
)
def test_headers(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "steps.csv").write_text(text)
    with pytest.raises(InputError, match=rf"steps\.csv: {said}"):
        read_columns(tmp_path / "steps.csv")


def test_long_headers_are_cut_in_messages(tmp_path: Path) -> None:
    (tmp_path / "steps.csv").write_text(",".join(["name"] * 400) + "\n")
    with pytest.raises(InputError) as told:
        read_columns(tmp_path / "steps.csv")
    shown = str(told.value).partition("got ")[2]
    assert len(shown) == 200 and shown.startswith("name, name")


@pytest.mark.parametrize("missing", ["run.json", "steps.csv"])
def test_what_is_no_run(run: Path, missing: str) -> None:
    (run / missing).unlink()
    with pytest.raises(InputError, match=rf"expected the folder of a run \(run\.json, steps\.csv, vtk/.*\), found no {missing}"):
        open_run(run)


def test_instants_in_the_order_of_time(run: Path) -> None:
    series(run, blocks=[(0.2, "blocks_00002.vtu"), (0.1, "blocks_00001.vtu")], rigid=[(0.1, "rigid_00001.vtp"), (0.3, "rigid_00003.vtp")])
    vtk = run / "vtk"
    assert open_run(run).instants == (
        Instant(0.1, vtk / "blocks_00001.vtu", None, vtk / "rigid_00001.vtp"),
        Instant(0.2, vtk / "blocks_00002.vtu", None, None),
        Instant(0.3, None, None, vtk / "rigid_00003.vtp"),
    )
    write_collection(vtk / "contacts.pvd", [Entry(0.2, "contacts_00002.vtp", "contacts")])
    with pytest.raises(InputError, match=r"vtk: expected the file contacts_00002\.vtp of t = 0\.2 s, as a \.pvd of it says, found none"):
        open_run(run)
    (vtk / "contacts_00002.vtp").write_text("x")
    assert open_run(run).instants[1].contacts == vtk / "contacts_00002.vtp"


def test_files_of_other_folders_are_not_taken(run: Path, tmp_path: Path) -> None:
    series(run)
    (tmp_path / "secret.vtu").write_text("x")
    write_collection(run / "vtk" / "blocks.pvd", [Entry(0.1, "../../secret.vtu", "blocks")])
    with pytest.raises(InputError, match="expected a place within"):
        open_run(run)
