"""A real run's series through VTK's own readers, and through pyvista's twin of ParaView's: time, named blocks, units, what was computed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fcsim.running.case import load_case
from fcsim.running.checkpoint import read_checkpoint
from fcsim.running.folder import open_run
from fcsim.running.run import RunOptions, run_case
from fcsim.running.series.collection import Entry, read_collection, write_collection
from fcsim.running.series.units import UNITS, with_unit, without_unit
from fcsim.timestep.step import Step

pv = pytest.importorskip("pyvista")
GIVEN = {"steps": "6", "divisions": "2,1,1", "courses": "1", "blocks": "1.5"}
WRITTEN = (2, 4, 6)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[int, Step]]:
    """A small masonry wall between rigid platens, and its steps as they were computed."""
    directory, steps = tmp_path_factory.mktemp("run") / "wall", {}
    options = RunOptions(export_every=0, vtk_every=2)
    run_case(load_case("cases/masonry_wall"), GIVEN, directory, options, watch=lambda case, step: steps.update({step.number: step}))
    return directory, steps


def read_by_vtk(path: Path) -> Any:
    """The data set of a file, by VTK's reader for its type."""
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

    reader = (vtkXMLUnstructuredGridReader if path.suffix == ".vtu" else vtkXMLPolyDataReader)()
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    return pv.wrap(reader.GetOutput())


@pytest.mark.parametrize("number", WRITTEN)
def test_vtk_reads_what_was_computed(run: tuple[Path, dict[int, Step]], number: int) -> None:
    directory, steps = run
    step = steps[number]
    x = step.model.node_displacement(step.state.x)
    n = np.cumsum([len(body.points) for body in step.model.bodies])[-3]  # the blocks; two platens come last
    blocks, rigid, contacts = (
        read_by_vtk(directory / "vtk" / f"{name}_{number:05d}.{kind}")
        for name, kind in (("blocks", "vtu"), ("rigid", "vtp"), ("contacts", "vtp"))
    )
    assert_array_equal(blocks["displacement [m]"], x[:n])
    assert_array_equal(rigid["displacement [m]"], x[n:])
    assert_array_equal(blocks["velocity [m/s]"], step.model.node_velocity(step.state.v, step.state.x)[:n])
    assert_array_equal(contacts["reaction_normal [N]"], step.contact_force[:, 0])
    assert_array_equal(contacts["gap [m]"], step.contacts.gap)
    names = [body.name for body in step.model.bodies]
    assert list(rigid.field_data["body_names"]) == list(contacts.field_data["body_names"]) == names
    assert {float(data.field_data["TimeValue"][0]) for data in (blocks, rigid, contacts)} == {step.state.t}
    assert [names[k] for k in np.unique(rigid["body"])] == names[-2:]
    if number == WRITTEN[-1]:
        moments = read_checkpoint(directory / "checkpoint.h5")
        assert moments is not None
        assert_array_equal(blocks["displacement [m]"], step.model.node_displacement(moments[0].state.x)[:n])


def test_one_file_opens_the_series_with_time_and_named_blocks(run: tuple[Path, dict[int, Step]]) -> None:
    """By ParaView's reader a file of a time step is a block: its `part` is where, its `name` what it is called."""
    directory, steps = run
    assert [path.name for path in (directory / "vtk").glob("*.pvd")] == ["run.pvd"]
    reader = pv.PVDReader(directory / "vtk" / "run.pvd")
    assert reader.time_values == [steps[number].state.t for number in WRITTEN]
    for point, number in enumerate(WRITTEN):
        reader.set_active_time_point(point)
        assert [data.path for data in reader.active_datasets] == [
            f"{name}_{number:05d}.{kind}" for name, kind in (("blocks", "vtu"), ("contacts", "vtp"), ("rigid", "vtp"))
        ]
        assert reader.read()[0]["displacement [m]"].max() > 0
    text = (directory / "vtk" / "run.pvd").read_text()
    assert text.count('part="0" name="blocks"') == text.count('part="1" name="contacts"') == text.count('part="2" name="rigid"') == 3


def test_every_array_with_a_unit_says_it(run: tuple[Path, dict[int, Step]]) -> None:
    bare = {"body", "body_names", "status", "mu", "slave", "master", "identity", "normal", "TimeValue"}
    for path in (run[0] / "vtk").glob("*_00006.vt*"):
        data = read_by_vtk(path)
        assert {name for name in (*data.point_data, *data.cell_data, *data.field_data) if not name.endswith("]")} <= bare


def test_names_of_arrays_come_back() -> None:
    assert with_unit("gap") == "gap [m]" and with_unit("fracture") == "fracture" and with_unit("TimeValue") == "TimeValue"
    assert all(without_unit(with_unit(name)) == name == without_unit(name) for name in (*UNITS, "fracture", "held_0"))
    assert without_unit("mine [m]") == "mine [m]"  # of a law of one's own


def test_a_run_of_an_earlier_version_is_read_and_goes_on_as_one_series(run: tuple[Path, dict[int, Step]], tmp_path: Path) -> None:
    """fcsim 0.2 wrote a collection for each series, without names."""
    import shutil

    from fcsim.running.vtk_series import SeriesWriter

    vtk = tmp_path / "run" / "vtk"
    shutil.copytree(run[0], tmp_path / "run")
    entries = read_collection(vtk / "run.pvd")
    (vtk / "run.pvd").unlink()
    for name in ("blocks", "contacts", "rigid"):
        write_collection(vtk / f"{name}.pvd", [entry for entry in entries if entry.series == name])
        text = (vtk / f"{name}.pvd").read_text()
        (vtk / f"{name}.pvd").write_text(text.replace(f' name="{name}"', ""))
    new, old = open_run(run[0]).instants, open_run(tmp_path / "run").instants
    assert [instant.t for instant in old] == [instant.t for instant in new]
    assert all(instant.blocks and instant.contacts and instant.rigid for instant in old)
    SeriesWriter(vtk, run[1][6].model).write(run[1][6])
    assert [path.name for path in vtk.glob("*.pvd")] == ["run.pvd"] and read_collection(vtk / "run.pvd") == entries
    assert Entry(entries[0].t, "blocks_00002.vtu", "blocks") in entries
