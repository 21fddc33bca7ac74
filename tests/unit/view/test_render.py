"""Pictures, films and plots of a made-up run: they exist, show something, and show what the data say."""

import csv
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import colors
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from fcsim.errors import InputError, MissingDependency
from fcsim.records import to_json
from fcsim.running.description import Column, Description, HistoryPlot, Plots
from fcsim.running.folder import Instant, RunFolder, instants_in, open_run
from fcsim.running.series.collection import read_collection, write_collection
from fcsim.view import SeriesWriter, render, scene
from fcsim.view.film import film_instants, write_film
from fcsim.view.joints import find_joints
from fcsim.view.joints.draw import crack_colours
from fcsim.view.pictures import contact_figure, crack_figure, describe, instants_figure, stress_figure, stress_frames, write_pictures
from fcsim.view.plots import _sides, contact_plot, convergence_plot, energy_plot, history_plot, phase_plot, reaction_plot, write_plots
from fcsim.view.style import BLUE, RED, STYLE, matplotlib, prefixed, save


def share(image, colour, tolerance=6):
    """Share of the pixels that have a colour."""
    return np.mean(np.all(np.abs(image.astype(int) - (255 * np.array(colors.to_rgb(colour))).round()) <= tolerance, axis=-1))


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB"))


@pytest.fixture(scope="module")
def rendered(run_directory, tmp_path_factory):
    """(folder, files, progress) of a whole rendering."""
    directory = tmp_path_factory.mktemp("rendered") / "run"
    shutil.copytree(run_directory, directory)
    calls = []
    return directory, render(directory, progress=lambda *call: calls.append(call)), calls


def test_render_makes_every_file(rendered):
    directory, files, calls = rendered
    names = ["plots/reaction.png", "plots/contacts.png", "plots/convergence.png", "plots/phases.png"]
    names += ["pictures/stress.png", "pictures/instants.png", "pictures/contacts.png", "pictures/cracks.png", "film.gif"]
    assert files == [directory / name for name in names]
    assert not list(directory.rglob("*.partial"))
    assert [call for call in calls if call[0] == "film"] == [("film", k, 4) for k in (1, 2, 3, 4)]
    for path in files[:-1]:
        image = pixels(path)
        assert image.shape[1] >= 1200 and image.shape[0] >= 700
        assert image.std() > 12 and (image == 255).all(-1).mean() > 0.2  # something, on white


def test_the_contact_picture_shows_stick_and_slip(rendered):
    image = pixels(rendered[0] / "pictures" / "contacts.png")
    assert share(image, BLUE) > 1e-3 and share(image, RED) > 3e-4


def test_cracks_are_drawn_in_their_colours_and_gravity_as_an_arrow(fake, tmp_path):
    """Head joints open by the tilt of the courses; g points where gravity does, and is not drawn where there is none."""
    for gravity in (None, lambda t: (0.0, 0.0, -9.81), lambda t: (9.81, 0.0, 0.0)):
        model = replace(fake.wall(3, 4), gravity=gravity)
        SeriesWriter(tmp_path / "vtk", model).write(fake.step(model, 20, 20, 4))
        instants = instants_in(tmp_path / "vtk")
        run = RunFolder(tmp_path, Description(title="wall", h=1e-3), {}, instants)
        with matplotlib().rc_context(STYLE), scene.Scene(scene.survey(run, instants), "front", width=600) as view:
            drawing = crack_figure(run, view, instants[0], find_joints(instants[0], False))
            picture = tmp_path / "cracks.png"
        save(drawing, picture)
        assert share(pixels(picture), crack_colours()(1.0)[:3], 12) > 1e-4
        arrows = [text for text in drawing.axes[0].texts if getattr(text, "arrow_patch", None) is not None]
        assert len(arrows) == (gravity is not None)
        if gravity is not None:
            tip, tail = np.array(arrows[0].xy), np.array(arrows[0].xyann)
            expected = (0.0, 1.0) if gravity(0)[2] else (1.0, 0.0)  # pixels count downwards
            np.testing.assert_allclose((tip - tail) / np.linalg.norm(tip - tail), expected, atol=1e-12)


def test_the_film_moves(rendered):
    film = Image.open(rendered[0] / "film.gif")
    assert film.n_frames == 4 and film.info["loop"] == 0
    assert (rendered[0] / "film.gif").stat().st_size < 8e6
    frames = []
    for k in range(4):
        film.seek(k)
        frames.append(np.asarray(film.convert("RGB")).astype(int))
    body = slice(frames[0].shape[0] // 5, -frames[0].shape[0] // 5)  # without title and colour bar
    for one, other in pairwise(frames):
        assert np.mean(np.abs(one[body] - other[body]).max(-1) > 20) > 0.02


def test_a_film_draws_once_what_its_frames_share(run_directory, monkeypatch):
    """Each frame has the pixels of that instant's own picture, also after the ones before it; gravity turns meanwhile."""
    monkeypatch.setattr("fcsim.view.pictures.gravity_of", lambda instant: np.array([9.0 * instant.t, 0.0, -1.0]) if instant.t else None)
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    run = open_run(run_directory)
    instants = (run.instants[0], run.instants[-1], run.instants[1])
    with matplotlib().rc_context(STYLE), scene.Scene(scene.survey(run, run.instants), width=300) as view:
        for instant, frame in zip(instants, stress_frames(run, view, instants), strict=True):
            canvas = FigureCanvasAgg(stress_figure(run, view, instant))
            canvas.draw()
            np.testing.assert_array_equal(frame, np.asarray(canvas.buffer_rgba())[..., :3])


def test_mp4(run_directory, tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    run = open_run(run_directory)
    path = write_film(run, scene.survey(run, run.instants[:2]), tmp_path / "film.mp4", "mp4")
    assert imageio_ffmpeg.count_frames_and_secs(path)[0] == 4
    assert list(tmp_path.iterdir()) == [path]


def test_a_film_has_at_most_100_frames(run_directory):
    run = open_run(run_directory)
    many = RunFolder(run.directory, {}, {}, tuple(Instant(float(k), None, None, None) for k in range(1234)))
    chosen = [instant.t for instant in film_instants(many)]
    assert len(chosen) == 100 and chosen[0] == 0 and chosen[-1] == 1233 and np.ptp(np.diff(chosen)) <= 1


def test_automatic_exaggeration_shows_5_to_8_percent(run_directory):
    run = open_run(run_directory)
    seen = scene.survey(run, run.instants)
    moved = max(float(np.linalg.norm(scene.read(i.blocks)["displacement"], axis=1).max()) for i in run.instants)
    assert 0.05 <= seen.exaggeration * moved / 0.76 <= 0.08  # 0.76 m: the platens' length
    assert scene.survey(run, run.instants, 7.5).exaggeration == 7.5
    assert scene._automatic(1.0, 0.3) == 1.0 and scene._automatic(1.0, 0.0) == 1.0
    assert scene._automatic(1.0, 1e-14) == 1.0  # round-off of a state at rest
    for moved in 10 ** np.random.default_rng(0).uniform(-9, np.log10(0.05), 200):
        assert 0.05 <= scene._automatic(1.0, moved) * moved <= 0.08 * (1 + 1e-9)
    assert (scene._automatic(1.0, 1e-3, 7.9), scene._automatic(1.0, 1e-3, 1.2), scene._automatic(1.0, 1e-3, 1e3)) == (6.0, 1.0, 80.0)
    with pytest.raises(InputError, match="exaggeration"):
        scene.survey(run, run.instants, -1.0)


def test_the_title_states_time_displacement_and_factor(run_directory):
    run = open_run(run_directory)
    with scene.Scene(scene.survey(run, run.instants[-1:], 50.0), width=300) as view:
        texts = [text.get_text() for text in stress_figure(run, view, run.instants[-1]).texts]
    assert texts[0] == "Masonry wall under compression and shear"
    assert texts[1] == "t = 0.500 s   ·   imposed displacement −0.450 mm   ·   displacements × 50"


@pytest.mark.parametrize("value", [-0.0, -1e-9])
def test_what_rounds_to_nothing_has_no_sign(run_directory, value):
    """The wall before it is sheared was said to be so along -x by "−0.000 m"."""
    run = open_run(run_directory)
    numbers = np.array([value, 1.0])
    told = SimpleNamespace(description=run.description, plots=run.plots, at=lambda name, t: value, numbers=lambda name: numbers)
    said = describe(told, SimpleNamespace(survey=SimpleNamespace(exaggeration=1.0)), run.instants[-1])
    assert "imposed displacement 0.000 m" in said


def test_no_text_of_the_instants_covers_another_or_leaves_the_page(run_directory):
    run = open_run(run_directory)
    imposed = replace(run.plots.imposed, label="imposed displacement of the upper platen of the wall along -x")
    run = replace(run, description=replace(run.description, plots=replace(run.plots, imposed=imposed)))
    with scene.Scene(scene.survey(run, run.instants, 50.0), width=700) as view:
        page = instants_figure(run, view, list(run.instants))
        renderer = FigureCanvasAgg(page).get_renderer()
        boxes = [text.get_window_extent(renderer) for text in page.texts]
        assert len(boxes) == 2 + len(run.instants)
        assert all(box.x0 >= 0 and box.x1 <= page.bbox.x1 for box in boxes)
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_points_stand_where_the_camera_shows_them(run_directory):
    run = open_run(run_directory)
    only_platens = Instant(0.5, None, None, run.instants[-1].rigid)
    seen = scene.survey(run, (only_platens,), 1.0)
    for view in ("oblique", "front"):
        with scene.Scene(seen, view, width=400) as camera:
            image = camera.image(only_platens)
            at = camera.pixels(camera.shown(scene.read(only_platens.rigid)))
        rows, columns = np.nonzero((image < 250).any(-1))
        assert np.abs([columns.min() - at[:, 0].min(), columns.max() - at[:, 0].max()]).max() < 3
        assert np.abs([rows.min() - at[:, 1].min(), rows.max() - at[:, 1].max()]).max() < 3


def test_stress_colours_are_those_of_the_colour_bar(fake, tmp_path):
    fake.write_run(tmp_path, d=2, steps=4, every=4, divisions=4)  # 2D: no shading
    run = open_run(tmp_path)
    seen = scene.survey(run, run.instants)
    assert seen.planar
    stress = scene.read(run.instants[-1].blocks)["von_mises"]
    assert seen.stress == (0.0, pytest.approx(np.percentile(stress, 99)))
    with scene.Scene(seen, width=600) as view:
        image = view.image(run.instants[-1])
        assert contact_figure(run, view, run.instants[-1]).legends
    softest, hardest = scene.colour_map()(stress.min() / seen.stress[1])[:3], scene.colour_map()(1.0)[:3]
    assert share(image, softest, 3) > 0.01 and share(image, hardest, 3) > 0.003


def test_rigid_bodies_alone_are_drawn(run_directory, tmp_path, small_pictures):
    shutil.copytree(run_directory, tmp_path / "run")
    collection = tmp_path / "run/vtk/run.pvd"
    write_collection(collection, [entry for entry in read_collection(collection) if entry.series != "blocks"])
    run = open_run(tmp_path / "run")
    seen = scene.survey(run, run.instants[-1:])
    assert seen.stress is None
    with scene.Scene(seen, width=300) as view:
        assert view.image(run.instants[-1]).std() > 10
        assert len(stress_figure(run, view, run.instants[-1]).axes) == 1  # no colour bar
    names = {path.name for path in write_pictures(run, seen, tmp_path / "pictures")}
    assert "stress.png" not in names and "bodies.png" in names


def test_an_instant_without_contacts_is_drawn(fake, run_directory, tmp_path):
    shutil.copytree(run_directory, tmp_path / "run")
    SeriesWriter(tmp_path / "run/vtk", model := fake.wall(3, 4)).write(fake.without_contacts(fake.step(model, 20, 20, 4)))
    run = open_run(tmp_path / "run")
    with scene.Scene(scene.survey(run, run.instants[-1:]), "front", width=300) as view:
        labels = [text.get_text() for text in contact_figure(run, view, run.instants[-1]).legends[0].get_texts()]
    assert labels[:3] == ["open (0)", "stick (0)", "slip (0)"]


def test_reaction_plot_draws_the_columns_as_they_are(run_directory):
    """A plot that turns signs round by itself is read against the table, and against the next run's plot, wrongly."""
    run = open_run(run_directory)
    drawing = reaction_plot(run)
    axes = drawing.axes[0]
    with (run_directory / "steps.csv").open() as file:
        rows = list(csv.DictReader(file))
    bottom, top, bound, other = axes.lines
    np.testing.assert_allclose(bottom.get_xdata(), [1e3 * float(row["top_x"]) for row in rows])  # mm
    np.testing.assert_allclose(bottom.get_ydata(), [1e-3 * float(row["bottom_Rx"]) for row in rows])  # kN
    np.testing.assert_allclose(top.get_ydata(), [1e-3 * float(row["top_Rx"]) for row in rows])
    assert bound.get_ydata() == pytest.approx([15.9726, 15.9726]) and "15.97 kN" in bound.get_label()
    assert other.get_ydata() == pytest.approx([-15.9726, -15.9726])  # one reaction is positive, the other negative
    assert axes.get_xlabel() == "imposed displacement [mm]" and axes.get_ylabel() == "reaction [kN]"
    assert [text.get_text() for text in drawing.legends[0].get_texts()][1] == "horizontal reaction at the top"


def test_reactions_of_a_case_that_imposes_nothing_are_drawn_over_time(run_directory):
    """Gravity alone drives an arch or a pile: its reactions were named and not drawn."""
    run = open_run(run_directory)
    drawing = reaction_plot(replace(run, description=replace(run.description, plots=replace(run.plots, imposed=None))))
    (line, *_), axes = drawing.axes[0].lines, drawing.axes[0]
    with (run_directory / "steps.csv").open() as file:
        rows = list(csv.DictReader(file))
    scale = {"time [s]": 1.0, "time [ms]": 1e3}[axes.get_xlabel()]
    np.testing.assert_allclose(line.get_xdata(), [scale * float(row["t"]) for row in rows])
    np.testing.assert_allclose(line.get_ydata(), [1e-3 * float(row["bottom_Rx"]) for row in rows])  # kN


@pytest.mark.parametrize(("factor", "sides"), [(1.0, [1.0, -1.0]), (-1.0, [1.0, -1.0]), (1e-9, [1.0])])
def test_the_bound_is_on_the_sides_of_the_reactions(factor, sides):
    values = factor * np.array([0.0, 3.0, -2.0])
    assert _sides([values], 3.0) == sides
    assert _sides([-np.abs(values)], 3.0) == [-1.0] and _sides([np.full(3, np.nan)], 3.0) == [1.0]


def test_long_legends_are_not_cut(run_directory):
    """Eight curves of which each has a name longer than the plot is wide."""
    run = open_run(run_directory)
    words = "horizontal reaction of the third course from the top at the left side of the doorway, without its lintel "
    curves = tuple(Column("bottom_Rx", f"{k}: {words}{words}", "N") for k in range(8))
    drawing = history_plot(run, HistoryPlot("forces", Column("t", "time", "s"), curves))
    long = RunFolder(run.directory, replace(run.description, plots=replace(run.plots, reaction=curves[:4])), run.columns, ())
    for figure in (drawing, reaction_plot(long)):
        figure.draw_without_rendering()
        (legend,) = figure.legends
        box = legend.get_window_extent()
        assert figure.axes[0].get_window_extent().height > 200
        assert 0 <= box.x0 < box.x1 <= figure.bbox.width and 0 <= box.y0 < box.y1 <= figure.bbox.height
        assert sum("its lintel" in " ".join(text.get_text().split()) for text in legend.get_texts()) == 8 - 4 * (figure is not drawing)


def test_steps_that_failed_are_marked(run_directory):
    run = open_run(run_directory)
    status = run.columns["status"].astype("U14").copy()
    status[[3, 8]] = "MAX_ITERATIONS"
    failed = RunFolder(run.directory, run.description, {**run.columns, "status": status}, ())
    crosses = [line for line in convergence_plot(failed).axes[0].lines if line.get_marker() == "x"]
    assert [list(line.get_xdata()) for line in crosses] == [[4, 9]]
    assert not [line for line in convergence_plot(run).axes[0].lines if line.get_marker() == "x"]


@pytest.mark.parametrize("format", ["png", "svg"])
def test_plots_leave_no_pyplot_figure(run_directory, tmp_path, format):
    import matplotlib.pyplot as plt

    settings = dict(plt.rcParams)
    files = write_plots(open_run(run_directory), tmp_path, format=format)
    assert [file.name for file in files] == [f"{name}.{format}" for name in ("reaction", "contacts", "convergence", "phases")]
    assert all(file.stat().st_size > 5000 for file in files)
    assert plt.get_fignums() == [] and dict(plt.rcParams) == settings
    if format == "svg":
        assert "imposed displacement" in files[0].read_text()  # text stays text


def test_plots_without_their_columns_are_left_out(tmp_path):
    (tmp_path / "run.json").write_text("{}")
    (tmp_path / "steps.csv").write_text("step,t,error\n1,0.1,1e-9\n2,0.2,0\n3,0.3\n")  # the last row was cut
    run = open_run(tmp_path)
    assert list(run.numbers("step")) == [1, 2] and run.title == tmp_path.name
    assert reaction_plot(run) is None and contact_plot(run) is None and phase_plot(run) is None
    assert render(tmp_path) == [tmp_path / "plots" / "convergence.png"]  # no series, no pictures
    (tmp_path / "steps.csv").write_text("step,t,error,nc,seconds_solve\n")
    with pytest.raises(InputError, match="step"):
        render(tmp_path, film=None)


def test_steps_are_counted_in_whole_numbers(tmp_path):
    """Of three steps the axis had ticks at 1.25 and 1.5."""
    (tmp_path / "run.json").write_text("{}")
    (tmp_path / "steps.csv").write_text("step,t,error,seconds_solve\n1,0.1,1e-9,1\n2,0.2,0,2\n3,0.3,0,1\n")
    ticks = phase_plot(open_run(tmp_path)).axes[0].get_xticks()
    assert {1, 2, 3} <= set(ticks) and all(tick == round(tick) for tick in ticks)


def test_a_folder_that_is_no_run_is_refused(run_directory, tmp_path):
    with pytest.raises(InputError, match=rf"{tmp_path}: expected the folder of a run .*run\.json.*found no run\.json"):
        render(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(InputError, match=r"found no steps\.csv"):
        render(tmp_path)
    (tmp_path / "steps.csv").write_text("")
    with pytest.raises(InputError, match=r"steps\.csv: expected a header"):
        render(tmp_path)
    (tmp_path / "run.json").write_text("{,}")
    with pytest.raises(InputError, match=r"run\.json: expected JSON"):
        render(tmp_path)
    with pytest.raises(InputError, match="'gif' or 'mp4'"):
        render(run_directory, film="avi")


def test_missing_and_broken_series_files_are_named(run_directory, tmp_path):
    shutil.copytree(run_directory, tmp_path / "run")
    victim = tmp_path / "run/vtk/blocks_00010.vtu"
    victim.write_bytes(victim.read_bytes()[:400])
    with pytest.raises(InputError, match=r"blocks_00010\.vtu: expected a VTK file"):
        render(tmp_path / "run", film=None)
    victim.unlink()
    with pytest.raises(InputError, match=r"vtk: expected the file blocks_00010\.vtu"):
        open_run(tmp_path / "run")


def test_importing_loads_no_graphics_library():
    code = "import sys, fcsim.view; print([m for m in ('pyvista', 'vtkmodules', 'matplotlib', 'PIL', 'dolfinx') if m in sys.modules])"
    root = Path(__file__).parents[3]
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root).stdout.strip() == "[]"


def test_missing_libraries_are_named(run_directory, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "matplotlib", None)
        with pytest.raises(MissingDependency, match=r"pip install 'fcsim\[view\]'"):
            render(run_directory)
    scene.offscreen.cache_clear()
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "pyvista", None)
        with pytest.raises(MissingDependency, match=r"pip install 'fcsim\[view\]'"):
            scene.offscreen()
    with monkeypatch.context() as patch:  # no OpenGL: the child process that tries ends badly
        patch.setattr(scene, "_PROBE", "import os; os.abort()")
        with pytest.raises(MissingDependency, match=r"OpenGL.*apt-get install libegl1"):
            scene.offscreen()


@pytest.mark.parametrize(
    ("unit", "value", "expected"),
    [
        ("m", 0.45e-3, (1e-3, "mm")),
        ("N", 15972.6, (1e3, "kN")),
        ("N", 268.0, (1.0, "N")),
        ("Pa", 4.5e5, (1e6, "MPa")),
        ("m", 0.0, (1.0, "m")),
        ("m", 3.0, (1.0, "m")),
        ("rad", 0.01, (1.0, "rad")),
        ("s", 0.32, (1e-3, "ms")),
        ("m", 1e-12, (1e-6, "µm")),
        ("J", 5e-11, (1e-12, "pJ")),
        ("N", 1.76e10, (1e9, "GN")),
    ],
)
def test_prefixes(unit, value, expected):
    assert prefixed(unit, [0.1 * value, -value], None, np.nan) == expected


def test_description_is_read_from_run_json(run_directory):
    stored = json.loads((run_directory / "run.json").read_text())
    read = to_json(open_run(run_directory).description)
    assert {name: read[name] for name in stored if name != "plots"} == {name: value for name, value in stored.items() if name != "plots"}
    assert read["plots"] == {**stored["plots"], "histories": []}


def energies_of(run: RunFolder, **columns: list[float]) -> RunFolder:
    table = {name: np.array(values) for name, values in columns.items()}
    return RunFolder(run.directory, run.description, {"t": np.array([1e-3, 2e-3, 3e-3]), **table}, ())


def test_the_energy_plot_adds_up_what_steps_exchange(run_directory):
    run = open_run(run_directory)
    assert energy_plot(run) is None  # a run without such columns
    columns = {"kinetic_energy": [2.0, 1.0, 0.0], "load_work": [1.0, 1.0, 2.0], "damping_dissipation": [0.0, 0.0, 0.0]}
    axes = energy_plot(energies_of(run, **columns)).axes[0]
    curves = {line.get_label(): line.get_ydata() for line in axes.lines}
    assert set(curves) == {"kinetic", "work of loads"}  # nothing was dissipated
    np.testing.assert_array_equal(curves["kinetic"], [2, 1, 0])
    np.testing.assert_array_equal(curves["work of loads"], [1, 2, 4])
    assert axes.get_xlabel() == "time [ms]" and axes.get_ylabel() == "energy [J]"
    assert energy_plot(energies_of(run, kinetic_energy=[0.0, 0.0, 0.0])) is None


def test_histories_of_a_case(run_directory, tmp_path):
    run = open_run(run_directory)
    time, top = Column("t", "time", "s"), Column("top_x", "top", "m")
    forces = tuple(Column(name, name, "N") for name in ("bottom_Rx", "top_Rx"))
    axes = history_plot(run, HistoryPlot("forces", top, forces)).axes[0]
    assert axes.get_xlabel().startswith("top [") and axes.get_ylabel() == "[kN]"
    np.testing.assert_allclose(axes.lines[0].get_ydata(), run.columns["bottom_Rx"] / 1e3)
    assert [line.get_label() for line in axes.lines] == ["bottom_Rx", "top_Rx"]
    assert history_plot(run, HistoryPlot("none", time, (Column("speed"),))) is None
    histories = (HistoryPlot("top", time, (top,)), HistoryPlot("none", time, ()))
    described = RunFolder(tmp_path, replace(run.description, plots=Plots(histories=histories)), run.columns, ())
    assert "top.png" in [path.name for path in write_plots(described)]
    assert "none.png" not in [path.name for path in (tmp_path / "plots").iterdir()]
