"""Pictures of masonry: what they show is within them, whatever its proportions, and no title is cut."""

from pathlib import Path

import numpy as np
import pytest

from fcsim.command_line.main import main
from fcsim.masonry import Block, MasonryProblem, structure, write_masonry
from fcsim.masonry.histories.branch import Branch
from fcsim.masonry.openings import Opening
from fcsim.mesh.solids.closed_surface import closed_surface

pytest.importorskip("pyvista")
pytest.importorskip("matplotlib")
from matplotlib.image import imread

from fcsim.view.blocks import draw_blocks
from fcsim.view.branch import draw_branch
from fcsim.view.cracks import draw_cracks

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], dtype=float)
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def box(name: str, low: tuple[float, ...], size: tuple[float, ...], **about: object) -> Block:
    return Block(closed_surface(name, (np.array(low) + CORNERS * size).tolist(), FACES), **about)  # type: ignore[arg-type]


def stone_on_ground(size: tuple[float, float, float], dimension: int) -> MasonryProblem:
    ground = box("ground", (0.0, 0.0, -0.01), (size[0], size[1], 0.01), support=True)
    return MasonryProblem("stone", dimension, (ground, box("stone", (0.0, 0.0, 0.0), size, density=2000.0)), mu=0.5)


@pytest.mark.each_value
@pytest.mark.parametrize("size", [(1.0, 1.0, 40.0), (1.0, 1.0, 1.0), (40.0, 1.0, 1.0), (1.0, 40.0, 1.0)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_blocks_of_any_proportions_are_within_their_picture(size: tuple[float, float, float], dimension: int, tmp_path: Path) -> None:
    ink = imread(draw_blocks(stone_on_ground(size, dimension), tmp_path / "a.png"))[..., :3].min(axis=2) < 0.97
    rim = 20  # pixel: below the text, which is in the upper left corner
    assert not ink[-rim:].any() and not ink[100:, :rim].any() and not ink[100:, -rim:].any() and not ink[:rim, 700:].any()
    drawn = ink[100:]
    across, down = np.flatnonzero(drawn.any(axis=0)), np.flatnonzero(drawn.any(axis=1))
    assert max(np.ptp(across) / ink.shape[1], np.ptp(down) / ink.shape[0]) > 0.4, "and fill it"


@pytest.mark.parametrize("size", [(22.0, 1.0, 8.5), (22.0, 1.0, 10.0), (1.0, 1.0, 9.0)])
def test_the_title_of_a_crack_map_is_whole(size: tuple[float, float, float], tmp_path: Path) -> None:
    problem = stone_on_ground(size, 2)
    model, _ = structure(problem)
    for title in ("a stone: 20 mm of its support", "a stone of a long name " * 8):
        drawn = draw_cracks(problem, model, np.zeros(model.n_dofs), (), tmp_path / "cracks.png", title)
        image = imread(drawn)[..., :3].min(axis=2)
        assert image[0].min() > 0.9 and image[:, 0].min() > 0.9 and image[:, -1].min() > 0.9
        assert image[:40].min() < 0.5, "it is there"


@pytest.mark.parametrize(("support", "least"), [(0.2, 0.2), (3.0, 0.5)])
def test_a_crack_map_shows_supports(support: float, least: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lintel of 2 m on two supports beside its ends: they were cut off; of a large ground the part beside the lintel is enough."""
    posts = [box(name, (x, 0.0, -support), (support, 1.0, support), support=True) for name, x in (("left", -support), ("right", 2.0))]
    problem = MasonryProblem("lintel", 2, (*posts, box("lintel", (0.0, 0.0, 0.0), (2.0, 1.0, 0.3), density=2000.0)), mu=0.5)
    model, _ = structure(problem)
    drawn = []
    monkeypatch.setattr("fcsim.view.cracks.save", lambda drawing, path: drawn.append(drawing) or path)
    draw_cracks(problem, model, np.zeros(model.n_dofs), (), tmp_path / "cracks.png", "a lintel")
    axes = drawn[0].axes[0]
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert left <= -least and right >= 2.0 + least and bottom <= -least and top > 0.3
    assert right - left <= 2.0 * (1.0 + 2 * 0.25 + 0.15), "the lintel stays large"


@pytest.mark.parametrize(("opening", "shown"), [(5e-10, False), (1e-3, True)])
def test_round_off_is_no_crack(opening: float, shown: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stone that slides had a joint as dark and wide as the widest crack, "0.0007 um" open."""
    problem = stone_on_ground((1.0, 1.0, 1.0), 2)
    model, _ = structure(problem)
    drawn = []
    monkeypatch.setattr("fcsim.view.cracks.save", lambda drawing, path: drawn.append(drawing) or path)
    joint = Opening(("ground", "stone"), opening, 0.01, ((0.0, 0.0), (1.0, 0.0)))
    draw_cracks(problem, model, np.zeros(model.n_dofs), (joint,), tmp_path / "cracks.png", "a stone")
    axes, *bars = drawn[0].axes
    widths = [line.get_linewidth() for line in axes.lines]
    assert (max(widths) > 5.0) is shown and len(bars) == shown
    assert (axes.get_title(loc="left") == "no joint is open") is not shown


def test_the_number_of_a_branch_is_below_its_title(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Under a title of two lines it could not be read."""
    drawn = []
    monkeypatch.setattr("fcsim.view.branch.save", lambda drawing, path: drawn.append(drawing) or path)
    branch = Branch(np.array([0.0, 0.01]), np.array([37.4, 34.2]))
    draw_branch(branch, tmp_path / "branch.png", "an arch of a long name " * 6)
    drawn[0].canvas.draw()
    axes = drawn[0].axes[0]
    number = next(text for text in axes.texts if text.get_text() == "37.4")
    assert number.get_window_extent().y1 < axes.get_window_extent().y1


@pytest.mark.parametrize("name", ["stone", "stone.xyz"])
def test_a_picture_of_no_known_kind_is_refused(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`info --draw` ended in a traceback of matplotlib's."""
    write_masonry(tmp_path / "m.json", stone_on_ground((1.0, 1.0, 1.0), 3))
    assert main(["info", str(tmp_path / "m.json"), "--draw", str(tmp_path / name)]) == 2
    said = capsys.readouterr()
    assert "expected the name of a picture, .png, .jpg, .svg, .pdf" in said.err and not said.out
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize(("name", "begins"), [("a.jpg", b"\xff\xd8"), ("a.PNG", b"\x89PNG"), ("a.pdf", b"%PDF")])
def test_the_suffix_says_the_kind(name: str, begins: bytes, tmp_path: Path) -> None:
    drawn = draw_blocks(stone_on_ground((1.0, 1.0, 1.0), 3), tmp_path / name)
    assert drawn.read_bytes().startswith(begins)
