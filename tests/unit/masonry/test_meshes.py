"""Masonry problems from meshes: what stands and falls is that of the same blocks given otherwise."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest

from fcsim.arrays import FloatArray, IntArray
from fcsim.command_line.main import main
from fcsim.errors import EXIT_BAD_INPUT, EXIT_OK, InputError
from fcsim.masonry import analyse, limit_problem, masonry_of_mesh, pushed, read_model, structure
from fcsim.mesh.solids.mesh_skin import pieces_of, skin_of
from fcsim.runtime import gmsh_model

pytestmark = pytest.mark.usefixtures("read_here")

TOGETHER = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def brick(low: tuple[float, ...], high: tuple[float, ...], n: tuple[int, int, int]) -> tuple[FloatArray, IntArray]:
    """Points and hexahedra of a box in n cells."""
    axes = [np.linspace(a, b, k + 1) for a, b, k in zip(low, high, n, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    corner = np.stack(np.meshgrid(*map(np.arange, n), indexing="ij"), axis=-1).reshape(-1, 3)
    places = corner[:, None] + TOGETHER
    return points, (places[..., 0] * (n[1] + 1) + places[..., 1]) * (n[2] + 1) + places[..., 2]


def bricks(*boxes: tuple[FloatArray, IntArray]) -> tuple[FloatArray, IntArray, IntArray]:
    """Points, cells and the number of the box of each cell, no nodes shared."""
    starts = np.cumsum([0, *(len(points) for points, _ in boxes)])
    cells = np.concatenate([cells + start for (_, cells), start in zip(boxes, starts[:-1], strict=True)])
    return np.concatenate([points for points, _ in boxes]), cells, np.repeat(np.arange(len(boxes)), [len(cells) for _, cells in boxes])


@pytest.fixture
def column() -> tuple[FloatArray, IntArray, IntArray]:
    """Two drums of 0.4 x 0.4 x 0.5 m on each other, of different cells."""
    return bricks(brick((0, 0, 0), (0.4, 0.4, 0.5), (3, 2, 2)), brick((0, 0, 0.5), (0.4, 0.4, 1.0), (2, 3, 1)))


def write(path: Path, points: FloatArray, cells: IntArray, kind: str = "hexahedron", **data: object) -> Path:
    meshio.Mesh(points, [(kind, cells)], cell_data={key: [np.asarray(values)] for key, values in data.items()}).write(path)
    return path


def overturning(path: Path, **options: object) -> float:
    return analyse(pushed(masonry_of_mesh(path, mu=0.7, **options), (1.0, 0.0, 0.0))).coulomb.multiplier  # type: ignore[arg-type]


@pytest.mark.parametrize("suffix", [".vtu", *(pytest.param(other, marks=pytest.mark.slow) for other in (".vtk", ".xdmf"))])
def test_a_column_of_pieces_topples_at_its_proportion(suffix: str, column: tuple[FloatArray, IntArray, IntArray], tmp_path: Path) -> None:
    """Without groups: pieces that share no nodes are blocks, and flat faces touch at their corners however they are meshed."""
    path = write(tmp_path / f"column{suffix}", column[0], column[1])
    problem = masonry_of_mesh(path, mu=0.7)
    assert [block.name for block in problem.blocks] == ["column.1", "column.2", "floor"]
    assert all(len(block.surface.points) == 8 and len(block.surface.polygons) == 6 for block in problem.blocks)
    assert len(limit_problem(problem).contacts) == 8
    assert overturning(path) == pytest.approx(0.4, rel=1e-4)


@pytest.mark.slow
def test_an_array_of_numbers_parts_what_shares_nodes(tmp_path: Path) -> None:
    """One brick of 0.4 x 0.4 x 1 m, cut by numbers into a block that is held and one that topples at 0.4 / 0.5."""
    points, cells = brick((0, 0, 0), (0.4, 0.4, 1.0), (1, 1, 4))
    course = (points[cells].mean(axis=1)[:, 2] > 0.5).astype(np.int32)
    path = write(tmp_path / "a.vtu", points, cells, block=course, temperature=np.linspace(0, 1, len(cells)))
    assert overturning(path, supports=["0"]) == pytest.approx(0.7, rel=1e-3)  # it slides
    problem = pushed(masonry_of_mesh(path, mu=0.9, supports=["0"]), (1.0, 0.0, 0.0))
    assert analyse(problem).coulomb.multiplier == pytest.approx(0.8, rel=1e-4)
    two = write(tmp_path / "two.vtu", points, cells, course=course, number=np.arange(len(cells)))
    with pytest.raises(InputError, match=r"two\.vtu: expected the name of the array that says which part a cell is in, got 'course', 'n"):
        masonry_of_mesh(two)
    assert len(masonry_of_mesh(two, array="number").blocks) == 5
    with pytest.raises(InputError, match=r"two\.vtu: expected an array of whole numbers, one a cell, among 'course', 'number', "):
        masonry_of_mesh(two, array="stone")


def gmsh_column(path: Path, *, grouped: int = 2, order: int = 1, hexahedra: bool = False) -> Path:
    """Two boxes with a face in common (fragments), the lower one 0.4 x 0.4 x 0.3 m, the upper one 0.5 m high."""
    with gmsh_model("column") as gmsh:
        low, high = gmsh.model.occ.addBox(0, 0, 0, 0.4, 0.4, 0.3), gmsh.model.occ.addBox(0, 0, 0.3, 0.4, 0.4, 0.5)
        gmsh.model.occ.fragment([(3, low)], [(3, high)])
        gmsh.model.occ.synchronize()
        volumes = sorted((gmsh.model.occ.getCenterOfMass(3, tag)[2], tag) for _, tag in gmsh.model.getEntities(3))
        for (_, tag), name in list(zip(volumes, ("plinth", "drum"), strict=True))[:grouped]:
            gmsh.model.addPhysicalGroup(3, [tag], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)
        gmsh.option.setNumber("Mesh.SaveAll", 1 if grouped < 2 else 0)
        if hexahedra:
            gmsh.model.mesh.setTransfiniteAutomatic(recombine=True)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    return path


MESHES = [(1, False), *(pytest.param(*mesh, marks=pytest.mark.slow) for mesh in ((1, True), (2, False), (2, True)))]


@pytest.mark.parametrize(("order", "hexahedra"), MESHES)
def test_physical_groups_are_blocks(order: int, hexahedra: bool, tmp_path: Path) -> None:
    path = gmsh_column(tmp_path / "a.msh", order=order, hexahedra=hexahedra)
    problem = masonry_of_mesh(path, mu=0.9, supports=["pl*"])
    assert [(block.name, block.support) for block in problem.blocks] == [("plinth", True), ("drum", False)]
    assert [block.surface.moments()[0] for block in problem.blocks] == pytest.approx([0.048, 0.08], rel=1e-9)
    assert analyse(pushed(problem, (0.0, -1.0, 0.0))).coulomb.multiplier == pytest.approx(0.8, rel=1e-4)


@pytest.mark.slow
def test_without_groups_what_shares_nodes_is_one_block(tmp_path: Path) -> None:
    path = gmsh_column(tmp_path / "a.msh", grouped=0)
    problem = masonry_of_mesh(path)
    assert [block.name for block in problem.blocks] == ["a", "floor"]
    assert problem.blocks[0].surface.moments()[0] == pytest.approx(0.4 * 0.4 * 0.8)
    with pytest.raises(InputError, match="expected every cell in a group, of which blocks are made, got"):
        masonry_of_mesh(gmsh_column(tmp_path / "one.msh", grouped=1))
    with pytest.raises(InputError, match=r"expected physical groups for the parts of a \.msh file"):
        masonry_of_mesh(path, array="block")


@pytest.mark.slow
def test_in_millimetres(column: tuple[FloatArray, IntArray, IntArray], tmp_path: Path) -> None:
    path = write(tmp_path / "mm.vtu", 1e3 * column[0], column[1])
    assert overturning(path, scale=1e-3) == pytest.approx(0.4, rel=1e-4)
    with pytest.raises(InputError, match=r"expected blocks in m, got one of 500 m; scale=1e-3 if it is in mm"):
        masonry_of_mesh(path)


def test_deformable_blocks_are_made_of_their_cells(column: tuple[FloatArray, IntArray, IntArray], tmp_path: Path) -> None:
    problem = masonry_of_mesh(write(tmp_path / "a.vtu", column[0] + 3.0, column[1]), density=2500.0)
    model, remarks = structure(problem, "deformable")
    assert not remarks and len(model.rigid) == 1  # the floor
    assert [len(body.part.cells) for body in model.bodies if hasattr(body, "part")] == [12, 6]
    weight = model.mass @ np.ones(model.n_dofs)
    assert weight[: 3 * (4 * 3 * 3 + 3 * 4 * 2)].sum() / 3 == pytest.approx(2500 * 0.4 * 0.4 * 1.0)
    np.testing.assert_allclose(model.reference[:60].min(axis=0), (3.0, 3.0, 3.0), rtol=1e-12)


def test_a_face_with_a_hole_and_one_with_a_step(tmp_path: Path) -> None:
    """A ring of eight cubes keeps the facets of its two pierced faces; an L joins those of its concave ones."""
    cubes = [(x, y) for x in range(3) for y in range(3) if (x, y) != (1, 1)]
    points, cells, _ = bricks(*(brick((x, y, 0), (x + 1, y + 1, 1), (1, 1, 1)) for x, y in cubes))
    points, place = np.unique(points, axis=0, return_inverse=True)
    (ring,) = pieces_of("ring", points, place.reshape(-1)[cells], "hexahedron")
    surface = skin_of(ring)
    assert surface.moments()[0] == pytest.approx(8.0) and len(surface.polygons) == 2 * 8 + 4 + 4
    (corner,) = pieces_of("corner", points, place.reshape(-1)[cells][:4], "hexahedron")  # (0, 0), (0, 1), (0, 2), (1, 0)
    joined = skin_of(corner)
    assert joined.moments()[0] == pytest.approx(4.0) and len(joined.polygons) == 8 and len(joined.points) == 12


def test_bent_facets_of_neighbours_are_cut_alike(tmp_path: Path) -> None:
    """Two hexahedra whose common facet is no plane: no gap and no overlap between the two blocks."""
    points, cells = brick((0, 0, 0), (1, 1, 2), (1, 1, 2))
    points[np.flatnonzero((points == (1, 1, 1)).all(axis=1)), 2] += 0.1
    low, high = (pieces_of(str(k), points, cells[[k]], "hexahedron")[0] for k in (0, 1))
    volumes = [skin_of(piece).moments()[0] for piece in (low, high)]
    assert sum(volumes) == pytest.approx(2.0)
    assert volumes[0] == pytest.approx(1 + 0.1 / 3, rel=1e-9) or volumes[0] == pytest.approx(1 + 0.1 / 6, rel=1e-9)


def touching_by_an_edge() -> tuple[FloatArray, IntArray]:
    """Three cubes around an edge, and a fourth that bridges the two that meet in it alone: the skin touches itself there."""
    points, cells, _ = bricks(
        *(brick(low, tuple(np.add(low, 1)), (1, 1, 1)) for low in ((0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (1, 1, 0)))
    )
    points, place = np.unique(points, axis=0, return_inverse=True)
    return points, place.reshape(-1)[cells]


def inverted() -> tuple[FloatArray, IntArray]:
    points, cells = brick((0, 0, 0), (1, 1, 1), (1, 1, 2))
    cells[1] = cells[1][[4, 5, 6, 7, 0, 1, 2, 3]]
    return points, cells


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: (*brick((0, 0, 0), (1, 1, 1), (2, 2, 2)), "hexahedron"), None),
        (lambda: (*inverted(), "hexahedron"), "1 of them inverted"),
        (lambda: (*touching_by_an_edge(), "hexahedron"), "expected edges of two faces"),
        (lambda: (np.eye(4, 3), np.array([[0, 1, 2]]), "triangle"), "expected volume cells .* got a surface mesh in space"),
        (lambda: (np.eye(4, 3) * [1, 1, 0], np.array([[0, 1, 3]]), "triangle"), "expected solid cells, got triangle ones"),
        (lambda: (np.eye(4, 3), np.array([[0, 1]]), "line"), "expected volume cells .* got none but line"),
        (lambda: (TOGETHER.astype(float), np.array([[0, 1, 2, 3, 4]]), "pyramid"), "got pyramid: prisms, pyramids"),
        (lambda: (np.eye(4, 3) * np.nan, np.array([[0, 1, 2, 3]]), "tetra"), "expected finite coordinates"),
        (lambda: (np.eye(4, 3), np.array([[0, 1, 2, 2]]), "tetra"), "expected elements with a scaled Jacobian"),
        (lambda: (np.eye(4, 3), np.array([[0, 1, 2, 3], [0, 1, 2, 3]]), "tetra"), "expected each element once"),
    ],
)
def test_meshes_that_are_no_blocks(made: Callable[[], tuple[FloatArray, IntArray, str]], message: str | None, tmp_path: Path) -> None:
    points, cells, kind = made()
    path = write(tmp_path / "a.vtu", points, cells, kind)
    if message is None:
        assert len(masonry_of_mesh(path).blocks) == 2
        return
    with pytest.raises(InputError, match=message) as raised:
        masonry_of_mesh(path)
    assert str(path) in str(raised.value)


@pytest.mark.slow
def test_cells_of_two_kinds_are_refused(tmp_path: Path) -> None:
    points = np.vstack([TOGETHER, [[5.0, 0, 0], [6, 0, 0], [5, 1, 0], [5, 0, 1]]])
    meshio.Mesh(points, [("hexahedron", [range(8)]), ("tetra", [range(8, 12)])]).write(tmp_path / "a.vtu")
    with pytest.raises(InputError, match="expected cells of one type, got a mixture of hexahedron and tetrahedron"):
        masonry_of_mesh(tmp_path / "a.vtu")


def test_slips_of_the_user(column: tuple[FloatArray, IntArray, IntArray], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a mesh file, found none"):
        read_model(tmp_path / "none.vtu")
    path = write(tmp_path / "a.vtu", column[0], column[1])
    with pytest.raises(InputError, match="scale: expected a factor > 0"):
        read_model(path, scale=0.0)
    with pytest.raises(InputError, match="supports: expected names or patterns"):
        read_model(path, supports=["pier*"])
    (tmp_path / "wall.json").write_text("{}")
    with pytest.raises(InputError, match="array: expected it with a mesh"):
        read_model(tmp_path / "wall.json", array="block")


@pytest.mark.slow
def test_the_commands_take_meshes(
    column: tuple[FloatArray, IntArray, IntArray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "column.vtu", 1e3 * column[0], column[1], block=column[2] + 7)
    with_scale = ["--scale", "1e-3"]
    assert main(["info", str(path), *with_scale, "--array", "block"]) == EXIT_OK
    told = capsys.readouterr().out
    assert "2 free, 1 held (floor)" in told and "2 in 8 contacts" in told and "18, of which blocks are made" in told
    assert main(["limit", str(path), *with_scale, "--mu", "0.7", "--direction", "y"]) == EXIT_OK
    assert " 0.4\n" in capsys.readouterr().out
    assert main(["tilt", str(path), *with_scale, "--mu", "0.7", "--static"]) == EXIT_OK
    assert f"{math.degrees(math.atan(0.4)):.3f}" in capsys.readouterr().out
    assert main(["push", str(path), *with_scale, "--mu", "0.7", "--direction", "x", "--static"]) == EXIT_OK
    settled = ["settle", str(path), *with_scale, "--support", "7", "--move", "0,0,-0.001", "--steps", "2"]
    assert main([*settled, "--export", str(tmp_path / "moved.vtu.obj")]) == EXIT_OK
    assert main(["limit", str(path), "--direction", "x"]) == EXIT_BAD_INPUT  # in mm


@pytest.mark.slow
def test_deformable_and_rigid_meshes_fall_alike(
    column: tuple[FloatArray, IntArray, IntArray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Within 1 % of the proportion 0.4, as blocks that fcsim meshes itself."""
    import json

    path = write(tmp_path / "column.vtu", column[0], column[1])
    for blocks in ("rigid", "deformable"):
        assert main(["push", str(path), "--mu", "0.7", "--direction", "x", "--blocks", blocks, "--resolution", "0.01", "--json"]) == EXIT_OK
        stands, falls = json.loads(capsys.readouterr().out)["simulation"]["fall"]
        assert stands < 0.4 * 1.01 and falls > 0.4 * 0.98


def test_cells_that_are_no_solid_are_refused_before_they_are_bounded() -> None:
    """The same without a file: inverted, and a skin that touches itself."""
    for (points, cells), message in ((inverted(), "1 of them inverted"), (touching_by_an_edge(), "expected edges of two faces")):
        (piece,) = pieces_of("piece", points, cells, "hexahedron")
        with pytest.raises(InputError, match=message):
            skin_of(piece)


@pytest.mark.slow
def test_a_turned_column_in_other_formats(tmp_path: Path) -> None:
    """By 0.3 rad about z, away from the origin: it topples about its edge at 0.4 / cos 0.3; in float32, as named sets, as floats."""
    points, cells, number = bricks(brick((0, 0, 0), (0.4, 0.4, 0.5), (2, 2, 2)), brick((0, 0, 0.5), (0.4, 0.4, 1.0), (1, 1, 1)))
    c, s = math.cos(0.3), math.sin(0.3)
    points = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + (10.0, 5.0, 0.0)
    made = [
        write(tmp_path / "single.vtu", points.astype(np.float32), cells),
        write(tmp_path / "float.vtu", points, cells, id=number.astype(float)),
    ]
    sets = {name: [np.flatnonzero(number == k)] for k, name in enumerate(("low", "high"))}
    meshio.Mesh(points, [("hexahedron", cells)], cell_sets=sets).write(tmp_path / "sets.inp")
    for path in (*made, tmp_path / "sets.inp"):
        assert overturning(path, array="id" if path.stem == "float" else None) == pytest.approx(0.4 / c, rel=1e-4)
    assert [block.name for block in masonry_of_mesh(tmp_path / "sets.inp").blocks] == ["low", "high", "floor"]
    unknown = write(tmp_path / "nan.vtu", points, cells, id=np.full(len(cells), np.nan))
    with pytest.raises(InputError, match=r"nan\.vtu: expected an array of whole numbers, one a cell, among none, got 'id'"):
        masonry_of_mesh(unknown, array="id")
