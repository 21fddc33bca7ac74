"""A run's page in a real browser: it loads alone, moves, and says the numbers of steps.csv and of the VTK files.

    make browser-test

Chromium of the system, driven by playwright; skipped with a reason where either is missing.
"""

import csv
import re

import numpy as np
import pytest
import pyvista as pv

from fcsim.running.case import load_case
from fcsim.running.folder import open_run
from fcsim.running.outputs import RunOptions
from fcsim.running.run import run_case
from fcsim.view import render
from fcsim.view.joints import configuration, find_joints

pytestmark = pytest.mark.browser
TITLE = "$('view').data[5].colorbar.title.text"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A small sheared wall of the case masonry_wall, with its page."""
    directory = tmp_path_factory.mktemp("run") / "wall"
    script = load_case("cases/masonry_wall")
    given = {"steps": "40", "divisions": "4,2,2", "courses": "2", "blocks": "2.5"}
    run_case(script, given, directory, RunOptions(export_every=0, vtk_every=2))
    render(directory, film=None, page=True)
    return directory


@pytest.fixture
def opened(visited, run, request):
    """The page, ready, and what it said and asked for; of the width and colours that a test's parameter names."""
    with visited(run / "page.html", *getattr(request, "param", ())) as page:
        yield page


def rows(run):
    with (run / "steps.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_it_loads_without_errors_or_requests(opened, run):
    assert opened.said == []
    assert opened.asked == [(run / "page.html").resolve().as_uri()]
    assert opened.inner_text("#facts").startswith("status\tfinished")


def test_the_still_picture_gives_way_to_the_bodies(opened, run):
    assert "url(data:image/jpeg" in (run / "page.html").read_text(encoding="utf-8").split("<script")[0]
    assert opened.evaluate("$('view').style.backgroundImage") == ""


def slide(page, place):
    page.eval_on_selector("#instant", "(slider, place) => { slider.value = place; slider.dispatchEvent(new Event('input')); }", place)


def test_the_slider_moves_the_bodies_to_where_the_files_have_them(opened, run):
    opened.fill("#scale", "1000")  # far more than the multiples in which places are stored
    opened.dispatch_event("#scale", "change")
    for place in (0, 7, 19):
        slide(opened, place)
        data = pv.read(sorted((run / "vtk").glob("blocks_*.vtu"))[place])
        surface = data.extract_surface(algorithm="dataset_surface")
        true = np.asarray(surface.points) + 1000 * surface["displacement [m]"]
        drawn = np.array(opened.evaluate("['x', 'y', 'z'].map(axis => Array.from($('view').data[0][axis]))")).T
        assert max(np.linalg.norm(drawn - point, axis=1).min() for point in true) < 1e-4 * np.ptp(true)
        assert f"t = {float(rows(run)[int(data.field_data['TimeValue'][0] / 1e-3 + 0.5) - 1]['t']):.6g}" in opened.inner_text("#when")


def test_the_row_beside_it_is_that_of_steps_csv(opened, run):
    slide(opened, 9)
    step = int(re.search(r"step (\d+)", opened.inner_text("#when")).group(1))
    opened.click("text=This step, as in steps.csv")
    shown = dict(line.split("\t") for line in opened.inner_text("#row").splitlines())
    expected = next(row for row in rows(run) if int(row["step"]) == step)
    for name, value in expected.items():
        got = shown[next(key for key in shown if key.split(" [")[0] == name)]
        if value in ("", "nan"):
            assert got == "–" or got == value
        elif value.replace(".", "").replace("-", "").replace("e", "").replace("+", "").isdigit():
            assert float(got) == pytest.approx(float(value), rel=1e-11), name
        else:
            assert got == value


def test_a_click_picks_a_body_and_says_its_numbers(opened, run):
    slide(opened, 19)
    box = opened.locator("#view").bounding_box()
    x, y = box["x"] + 0.45 * box["width"], box["y"] + 0.5 * box["height"]
    opened.mouse.move(x - 4, y)
    opened.wait_for_timeout(800)
    opened.mouse.move(x, y)
    opened.wait_for_timeout(800)
    opened.mouse.down()
    opened.mouse.up()
    opened.wait_for_selector("#numbers tr", timeout=20_000)
    assert opened.inner_text("#what").startswith("Body ")
    vertex = opened.evaluate("pick.vertex")
    data = pv.read(sorted((run / "vtk").glob("blocks_*.vtu"))[-1])
    place = np.array(opened.evaluate("[0, 1, 2].map(i => motion.low[i] + motion.vertices.at(3 * pick.vertex + i))"))
    node = np.linalg.norm(np.asarray(data.points) - place, axis=1)
    assert vertex is not None
    if node.min() < 1e-5:  # of a block: its displacement is the file's
        said = dict(line.split("\t") for line in opened.inner_text("#numbers").splitlines())["displacement"]
        factor = {"mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "m": 1.0}[said.split()[1]]
        near = np.linalg.norm(np.asarray(data["displacement [m]"])[node < 1e-5], axis=1)
        assert np.abs(near - float(said.split()[0]) * factor).min() < 1e-3 * near.max()


def test_hiding_cutting_and_colouring_change_what_is_drawn(opened):
    opened.uncheck("#through")
    whole = opened.evaluate("$('view').data[0].i.length")
    opened.click("#hide summary")
    opened.uncheck("#bodies label:first-child input")
    assert 0 < opened.evaluate("$('view').data[0].i.length") < whole
    opened.select_option("#cut", "0")
    most = opened.evaluate("Math.max(...$('view').data[0].x)")
    assert most == pytest.approx(opened.evaluate("cut()[1]"))
    for kind in opened.eval_on_selector_all("#colour option", "options => options.map(option => option.value)"):
        opened.select_option("#colour", kind)
    assert opened.said == []


def test_openings_of_joints_are_those_of_the_surfaces(opened, run):
    """Drawn where the joints of the files have opened, in the colour of their width."""
    instants = open_run(run).instants
    joints = find_joints(instants[0], planar=False)
    opening = np.array([np.maximum(joints.opening(configuration(instant)), 0) for instant in instants])
    opened.check("#joints")
    for place in (19, 5):
        slide(opened, place)
        factor = {"mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "m": 1.0}[re.search(r"\[(.*)\]", opened.evaluate(TITLE)).group(1)]
        drawn = np.array(opened.evaluate("$('view').data[5].intensity")) * factor
        expected = opening[place][opening[place] > 1e-3 * opening.max()]
        assert abs(len(drawn) - len(expected)) <= 0.01 * len(expected) + 1  # one of a hair may be on either side
        assert drawn.max() == pytest.approx(expected.max(), abs=1e-4 * opening.max())
        assert drawn.sum() == pytest.approx(expected.sum(), rel=2e-3)
    opened.uncheck("#joints")
    assert opened.evaluate("$('view').data[5].x.length") == 0
    x, y, z = (opened.evaluate(f"$('view').data[6].{axis}.slice(0, 2)") for axis in "xyz")  # the arrow of gravity: down
    assert x[0] == x[1] and y[0] == y[1] and z[1] < z[0]


def test_play_goes_to_the_end_and_stops(opened):
    slide(opened, 0)
    opened.click("#play")
    assert opened.inner_text("#play") == "Pause"
    opened.wait_for_function("$('play').textContent === 'Play'", timeout=60_000)
    assert opened.input_value("#instant") == opened.get_attribute("#instant", "max")


def test_play_begins_with_a_frame_that_began_before_the_click(opened):
    slide(opened, 0)
    opened.evaluate("(() => { const own = requestAnimationFrame; requestAnimationFrame = f => own(t => f(t - 1000)); play(true); })()")
    opened.wait_for_function("now > 0", timeout=60_000)
    assert opened.said == []


@pytest.mark.parametrize("opened", [(1280, 900, "light"), (1280, 900, "dark"), (390, 844, "light"), (390, 844, "dark")], indirect=True)
def test_nothing_is_clipped_and_all_can_read_it(opened):
    assert opened.evaluate("document.documentElement.scrollWidth <= innerWidth")
    clipped = """() => [...document.querySelectorAll('h1, h2, h3, p, th, td, label, button, summary, output')]
        .filter(e => e.offsetParent && getComputedStyle(e).display !== 'inline' && e.scrollWidth > e.clientWidth + 1)
        .map(e => e.textContent)"""
    assert opened.evaluate(clipped) == []
    outside = """() => [...document.querySelectorAll('.plot text')].filter(text => {
        const own = text.getBoundingClientRect(), plot = text.closest('.plot').getBoundingClientRect();
        return own.width && (own.left < plot.left - 1 || own.right > plot.right + 1 || own.bottom > plot.bottom + 1);
    }).map(text => text.textContent)"""
    assert opened.evaluate(outside) == []
    axe = pytest.importorskip("axe_core_python.sync_playwright", reason="axe-core-python is not installed: pip install 'fcsim[browser]'")
    found = axe.Axe().run(opened)["violations"]
    assert [(rule["id"], [node["html"][:120] for node in rule["nodes"]]) for rule in found] == []


@pytest.mark.parametrize(("width", "height"), [(1280, 900), (1000, 1400)])
def test_what_is_wider_than_it_is_deep_and_high_is_seen_whole(visited, tmp_path, width, height):
    """Bricks over an edge: the last one was cut off by the view's right side."""
    run_case(load_case("cases/stack"), {"steps": "2"}, tmp_path / "stack", RunOptions(export_every=0, vtk_every=1))
    render(tmp_path / "stack", film=None, page=True)
    with visited(tmp_path / "stack" / "page.html", width, height) as page:
        scene = "$('view')._fullLayout.scene._scene"
        camera = [page.evaluate(f"Array.from({scene}.glplot.cameraParams.{name})") for name in ("model", "view", "projection")]
        points = np.array(page.evaluate(f"['x', 'y', 'z'].map((axis, i) => $('view').data[1][axis].map(x => x * {scene}.dataScale[i]))"))
    model, view, projection = (np.array(matrix).reshape(4, 4).T for matrix in camera)
    seen = projection @ view @ model @ np.vstack([points, np.ones(points.shape[1])])
    share = np.abs(seen[:2] / seen[3]).max()
    assert 0.7 < share < 1.0
