"""What a run's page holds, without a browser: arrays come back as they were, curves are those of steps.csv, nothing leads outside.

A browser opens pages in tests/browser.
"""

import base64
import gzip
import json
import re
import shutil
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from fcsim.running.description import Description
from fcsim.running.folder import RunFolder, instants_in, open_run
from fcsim.running.vtk_series import SeriesWriter
from fcsim.view import render
from fcsim.view.film import film_instants
from fcsim.view.joints import configuration, find_joints
from fcsim.view.joints.surface import surface_of
from fcsim.view.page import motion as motion_of_page
from fcsim.view.page.curves import drawn, graphs, shown_rows
from fcsim.view.page.encoding import scaled, size, whole
from fcsim.view.page.motion import motion
from fcsim.view.page.write import write_page
from fcsim.view.scene import survey


def decoded(entry):
    """What page.js does, in NumPy."""
    planes = np.frombuffer(gzip.decompress(base64.b64decode(entry["data"])), np.uint8).reshape(np.dtype(entry["type"]).itemsize, -1)
    unsigned = np.zeros(planes.shape[1], f"u{len(planes)}")
    for byte, plane in enumerate(planes):
        unsigned |= plane.astype(unsigned.dtype) << np.array(8 * byte, dtype=unsigned.dtype)
    rows = np.cumsum(unsigned.reshape(entry["n"], entry["row"]), axis=0, dtype=unsigned.dtype).view(entry["type"])
    return rows * entry.get("scale", 1)


@pytest.mark.parametrize("kind", [np.int8, np.int16, np.int32])
def test_whole_numbers_come_back(kind):
    range_ = np.iinfo(kind)
    values = np.random.default_rng(0).integers(range_.min, range_.max, (7, 5), dtype=kind, endpoint=True)
    np.testing.assert_array_equal(decoded(whole(values)), values)
    assert decoded(whole(values[:0])).shape == (0, 5)


def test_scaled_values_come_back_to_a_share_of_the_largest():
    values = np.random.default_rng(1).normal(size=(6, 4, 3)) * 1e-6
    np.testing.assert_allclose(decoded(scaled(values)), values.reshape(6, 12), atol=0.51 / 32767 * np.abs(values).max())
    np.testing.assert_array_equal(decoded(scaled(np.zeros((2, 3)))), 0)
    np.testing.assert_array_equal(decoded(scaled(np.array([[np.nan, np.inf, 2.0]]))), [[0, 0, 2]])


def test_a_surface_is_closed_and_has_the_sharp_edges_of_its_boxes(run_directory):
    data, surface = surface_of(open_run(run_directory).instants[-1].blocks)
    area = data.extract_surface(algorithm="dataset_surface").area
    corners = np.asarray(data.points)[surface.node][surface.triangle]
    own = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert own == pytest.approx(area, rel=1e-6)
    edge = np.sort(surface.triangle[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    assert set(np.unique(edge, axis=0, return_counts=True)[1]) == {2}  # each edge of a closed surface has two triangles
    ends = np.asarray(data.points)[surface.node][surface.line]
    boxes = [np.asarray(data.points)[surface.node][surface.body == number] for number in np.unique(surface.body)]
    around = sum(4 * np.ptp(box, axis=0).sum() for box in boxes)
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(around, rel=1e-6)
    np.testing.assert_array_equal(np.asarray(data.cell_data["body"])[surface.cell], surface.body[surface.triangle[:, 0]])


def test_the_motion_is_that_of_the_files(run_directory):
    run = open_run(run_directory)
    content = motion(run, run.instants, lambda done, total: None)
    assert content["t"] == [instant.t for instant in run.instants] and content["left_out"] == 0
    blocks, rigid = pv.read(run.instants[-1].blocks), pv.read(run.instants[-1].rigid)
    places = decoded(content["vertices"]).reshape(-1, 3) + content["low"]
    last = places + decoded(content["displacement"])[-1].reshape(-1, 3)
    true = np.vstack([np.asarray(data.points) + data["displacement [m]"] for data in (blocks, rigid)])
    nearest = np.array([np.linalg.norm(true - point, axis=1).min() for point in last])
    assert nearest.max() < np.sqrt(3) / 2 / 32767 * 1.01 * np.ptp(true)  # half a multiple along each axis
    assert decoded(content["stress"]).max() == pytest.approx(max(pv.read(i.blocks)["von_mises [Pa]"].max() for i in run.instants), rel=1e-3)
    contacts = pv.read(run.instants[-1].contacts)
    first = content["contacts"]["first"]
    np.testing.assert_allclose(
        decoded(content["contacts"]["reaction"])[first[-2] :], contacts["reaction [N]"], atol=1e-4 * np.abs(contacts["reaction [N]"]).max()
    )
    np.testing.assert_array_equal(decoded(content["contacts"]["status"])[first[-2] :, 0], contacts["status"])


def test_gravity_and_joints_are_in_it(fake, tmp_path):
    """Gravity of each instant as the run had it; corners of a joint's facets by the page's own vertices."""
    model = replace(fake.wall(3, 4), gravity=lambda t: (9.81 * t, 0.0, -9.81))
    writer = SeriesWriter(tmp_path / "vtk", model)
    for number in (10, 20):
        writer.write(fake.step(model, number, 20, 4))
    instants = instants_in(tmp_path / "vtk")
    content = motion(RunFolder(tmp_path, Description(), {}, instants), instants, lambda done, total: None)
    np.testing.assert_allclose(content["gravity"], [(9.81 * instant.t, 0.0, -9.81) for instant in instants])
    joints = find_joints(instants[0], planar=False)
    found = content["joints"]
    places = decoded(content["vertices"]).reshape(-1, 3) + content["low"]
    vertex, weight = decoded(found["vertex"]), decoded(found["weight"]).reshape(-1, 3, 3)
    corners = np.einsum("fck,fkd->fcd", weight, places[vertex.astype(int)])
    np.testing.assert_allclose(corners, joints.corners(configuration(instants[0], 0.0)), atol=1e-4 * np.ptp(places))
    for row, instant in zip(decoded(found["opening"]), instants, strict=True):
        np.testing.assert_allclose(row, np.maximum(joints.opening(configuration(instant)), 0), atol=1e-4 * row.max())


def test_many_instants_are_thinned_to_the_room_there_is(run_directory, monkeypatch):
    run = open_run(run_directory)
    whole_run = size(motion(run, run.instants, lambda done, total: None))
    monkeypatch.setattr(motion_of_page, "BYTES", int(0.8 * whole_run))
    thin = motion(run, run.instants, lambda done, total: None)
    assert size(thin) < whole_run and thin["left_out"] > 0
    assert thin["t"][0] == run.instants[0].t and thin["t"][-1] == run.instants[-1].t


def test_curves_are_the_columns(run_directory):
    run = open_run(run_directory)
    rows = shown_rows(run)
    shown = {graph.title: drawn(graph) for graph in graphs(run, rows)}
    contacts = {curve["label"]: curve["values"] for curve in shown["Contacts"]["curves"]}
    np.testing.assert_array_equal(contacts["candidates"], run.numbers("nc"))
    reaction = shown["Reactions"]
    factor = {"kN": 1e3, "N": 1.0, "MN": 1e6}[reaction["unit"]]
    np.testing.assert_allclose(np.array(reaction["curves"][0]["values"]) * factor, run.numbers(run.plots.reaction[0].column))


def test_the_page_is_one_file_that_asks_for_nothing(run_directory, tmp_path, small_pictures):
    directory = tmp_path / "run"
    shutil.copytree(run_directory, directory)
    files = render(directory, film=None, page=True)
    assert files[-1] == directory / "page.html"
    text = files[-1].read_text(encoding="utf-8")
    ours = text.replace(re.search(r"<script>\s*/\*\*\s*\* plotly.*?</script>", text, re.DOTALL).group(), "")
    assert not re.search(r"https?://|\bsrc\s*=|<link", ours)
    assert "default-src 'none'" in text
    content = json.loads(re.search(r'<script type="application/json" id="content">(.*?)</script>', text, re.DOTALL).group(1))
    assert content["title"] == open_run(directory).title
    assert set(content["columns"]) == set(open_run(directory).columns)
    look = re.search(r"background-image: url\(data:image/jpeg;base64,([^)]*)\)", text)
    assert look is not None
    first, drawn_there = Image.open(BytesIO(base64.b64decode(look.group(1)))), Image.open(directory / "pictures" / "stress.png")
    drawn_there.thumbnail(first.size)
    grey = [np.asarray(one.convert("L").resize((40, 30)), dtype=float) for one in (first, drawn_there)]
    assert np.abs(grey[0] - grey[1]).mean() < 3  # of 255: the run's picture, seen until the bodies are drawn


def test_a_hostile_title_stays_text(run_directory, tmp_path):
    directory = tmp_path / "run"
    shutil.copytree(run_directory, directory)
    about = json.loads((directory / "run.json").read_text())
    about["title"] = "</script><script>alert(1)</script>"
    (directory / "run.json").write_text(json.dumps(about))
    run = open_run(directory)
    text = write_page(run, survey(run, film_instants(run))).read_text(encoding="utf-8")
    assert "<script>alert" not in text and "\\u003c/script>\\u003cscript>alert" in text


def test_a_run_without_vtk_has_curves_alone(run_directory, tmp_path):
    directory = tmp_path / "run"
    shutil.copytree(run_directory, directory, ignore=shutil.ignore_patterns("vtk"))
    text = render(directory, page=True)[-1].read_text(encoding="utf-8")
    content = json.loads(re.search(r'id="content">(.*?)</script>', text, re.DOTALL).group(1))
    assert content["motion"] is None and content["graphs"]
