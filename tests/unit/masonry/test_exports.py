"""Blocks where they have come to, written and read again."""

from pathlib import Path

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.masonry import MasonryProblem, read_model
from fcsim.masonry.atlas.shapes import arch, cuboid
from fcsim.masonry.exports import FORMATS, moved_blocks, write_blocks
from fcsim.masonry.openings import Opening
from fcsim.masonry.report import write_openings
from fcsim.masonry.structure import Stone, structure

pytestmark = pytest.mark.usefixtures("read_here")


def two(dimension: int) -> MasonryProblem:
    blocks = (cuboid("floor", (-1, -0.5, -1), (2, 1, 0), support=True), cuboid("stone", (0, 0, 0), (0.6, 0.5, 0.4)))
    return MasonryProblem(
        "two", dimension, blocks if dimension == 3 else (cuboid("floor", (-1, 0, -1), (2, 0.5, 0), support=True), blocks[1]), 0.6
    )


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("blocks_are", ["rigid", "deformable"])
def test_blocks_go_where_their_nodes_have_gone(dimension: int, blocks_are) -> None:  # type: ignore[no-untyped-def]
    problem = two(dimension)
    model, _ = structure(problem, blocks_are, Stone(cells=1.0))
    v = np.zeros(model.n_dofs)
    turn = 0.3
    if blocks_are == "rigid":
        rows = model.rigid_part(v)
        rows[1, :dimension], rows[1, -2 if dimension == 3 else -1] = 0.1, -turn if dimension == 2 else turn
        x = model.advance(np.zeros(model.n_dofs), v)
    else:
        v[: model.deformable[0].part.n_dofs if hasattr(model.deformable[0].part, "n_dofs") else model.dof_offset[1]] = 0.1
        x = v
    moved = moved_blocks(problem, model, x)
    points = moved.blocks[1].surface.points
    assert moved.blocks[1].surface.moments()[0] == pytest.approx(0.6 * 0.5 * 0.4)
    centre = moved.blocks[1].surface.moments()[1]
    expected = np.array([0.4, 0.35 if dimension == 3 else 0.25, 0.3])
    np.testing.assert_allclose(centre, expected, atol=1e-12)
    if blocks_are == "rigid":
        c, s = np.cos(turn), np.sin(turn)
        about = problem.blocks[1].surface.points - problem.blocks[1].surface.moments()[1]
        np.testing.assert_allclose(points - centre, about @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]), atol=1e-12)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_what_is_written_is_read_again(kind: str, dimension: int, tmp_path: Path) -> None:
    problem = two(dimension)
    path = write_blocks(tmp_path / f"blocks{kind}", problem)
    if kind == ".dxf":
        ezdxf = pytest.importorskip("ezdxf")
        drawing = ezdxf.readfile(path)
        assert not drawing.audit().errors
        found = {entity.get_xdata("FCSIM")[0][1]: entity for entity in drawing.modelspace()}
        assert set(found) == {"floor", "stone"} and found["stone"].dxf.layer == "BLOCKS" and found["floor"].dxf.layer == "SUPPORTS"
        if dimension == 2:
            corners = np.array([point[:2] for point in found["stone"].get_points()])
            assert np.ptp(corners, axis=0) == pytest.approx([0.6, 0.4])
        return
    again = read_model(path)
    volumes = sorted(block.surface.moments()[0] for block in again.blocks)
    for block in problem.blocks:
        assert np.isclose(volumes, block.surface.moments()[0], rtol=1e-6).any()
    if kind in (".obj", ".glb", ".3mf", ".json"):
        assert {"floor", "stone"} <= {block.name for block in again.blocks}
    if kind == ".json":
        assert again.blocks[0].support and again.mu == problem.mu and again.loads == problem.loads


def test_openings_of_round_off_are_none(tmp_path: Path) -> None:
    """2e-8 m of a stone of 0.6 m was written with six digits."""
    ends = ((0.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    write_openings(tmp_path / "o.csv", two(3), (Opening(("floor", "stone"), 2e-8, 3e-4, ends),))
    assert (tmp_path / "o.csv").read_text().split() == ["block,with,opening", "[mm],slip", "[mm]", "floor,stone,0,0.3"]


def test_compas_reads_its_meshes(tmp_path: Path) -> None:
    compas = pytest.importorskip("compas")
    pytest.importorskip("compas.datastructures")
    path = write_blocks(tmp_path / "arch.compas.json", arch(5, 0.2, 0.6))
    meshes = compas.json_load(path)
    assert len(meshes) == 7 and all(mesh.is_manifold() and mesh.volume() > 0 for mesh in meshes)


def test_other_names_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.obj"):
        write_blocks(tmp_path / "blocks.step", two(3))
