"""Mesh files: what is written comes back the same, and what cannot be used is refused by name."""

import meshio
import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.io import read_mesh, read_parts, write_mesh
from fcsim.mesh.material import ByRegion, Material
from fcsim.mesh.part import Part
from fcsim.mesh.quality import cell_volumes
from fcsim.runtime import gmsh_model

pytestmark = pytest.mark.usefixtures("read_here")

MATERIAL, MORTAR = Material(E=1e9, nu=0.2, density=2000), Material(E=1e8, nu=0.3, density=1800)
SQUARES = np.array([(x, y, 0) for y in (0, 1) for x in (0, 1, 2)], dtype=float)  # 2 unit squares, nodes 0 1 2 / 3 4 5
TWO_QUADS = np.array([(0, 1, 4, 3), (1, 2, 5, 4)])


def sample(cell):
    """A part with coordinates of all digits, a surface in reversed order that shares its facets with others, and a name to escape."""
    build, d = (brick, 3) if cell in ("hexahedron", "tetrahedron") else (rectangle, 2)
    part = build("my part", (1, np.sqrt(2), 3)[:d], (2, 3, 4)[:d], MATERIAL, cell, origin=(0.1, 1 / 3, 7.7)[:d])
    sides = np.concatenate((part.surfaces["x-"], part.surfaces["x+"]))[::-1]
    return Part(part.name, part.points, part.cells, cell, {**part.surfaces, "both sides & <others> 100%": sides}, MATERIAL)


@pytest.mark.parametrize("suffix", [".msh", ".vtu", ".vtk", ".xdmf"])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron", "quadrilateral", "triangle"])
def test_read_back_identically(cell, suffix, tmp_path):
    part = sample(cell)
    write_mesh(part, tmp_path / f"part{suffix}")
    back = read_mesh(tmp_path / f"part{suffix}", MATERIAL, plane="stress", thickness=0.3)
    assert back.name == ("my part" if suffix == ".msh" else "part")
    assert back.cell_type == cell
    assert np.array_equal(back.points, part.points)
    assert np.array_equal(back.cells, part.cells)
    assert list(back.surfaces) == list(part.surfaces)
    assert all(np.array_equal(back.surfaces[name], part.surfaces[name]) for name in part.surfaces)
    assert (back.plane, back.thickness, back.material) == ("stress", 0.3, MATERIAL)
    assert [path.name for path in tmp_path.iterdir()] == [f"part{suffix}"]  # no companion and no temporary file


@pytest.mark.parametrize("suffix", [".inp", ".med", ".mesh"])
def test_formats_without_names_are_written_only_without_surfaces(suffix, tmp_path):
    part, path = sample("hexahedron"), tmp_path / f"part{suffix}"
    with pytest.raises(InputError, match=r"keep the 7 surfaces of part 'my part', or surfaces=False"):
        write_mesh(part, path)
    assert not path.exists()
    write_mesh(part, path, surfaces=False)
    back = read_mesh(path, MATERIAL, name="again")
    assert np.array_equal(back.points, part.points)
    assert np.array_equal(back.cells, part.cells)
    assert (back.name, dict(back.surfaces)) == ("again", {})


@pytest.mark.parametrize(
    ("name", "message"), [("part.foo", "expected one of the extensions"), ("none/part.msh", "expected an existing folder")]
)
def test_places_that_cannot_be_written_are_refused(name, message, tmp_path):
    with pytest.raises(InputError, match=message):
        write_mesh(sample("triangle"), tmp_path / name)


@pytest.mark.parametrize("name", ['a "b"', "two\nlines", "a" * 128])
def test_names_that_gmsh_would_change_are_refused(name, tmp_path):
    part = rectangle("r", (1, 1), (1, 1), MATERIAL)
    with pytest.raises(InputError, match="expected names of 1 to 127 bytes"):
        write_mesh(Part("r", part.points, part.cells, part.cell_type, {name: part.surfaces["x-"]}, MATERIAL), tmp_path / "r.msh")


def test_a_surface_without_a_name_is_refused(tmp_path):
    part = rectangle("r", (1, 1), (1, 1), MATERIAL)
    with pytest.raises(InputError, match="expected surfaces with names"):
        write_mesh(Part("r", part.points, part.cells, part.cell_type, {"": part.surfaces["x-"]}, MATERIAL), tmp_path / "r.vtu")


@pytest.mark.parametrize("suffix", [".msh", ".vtu"])
def test_a_failed_write_leaves_nothing_behind(suffix, tmp_path):
    (tmp_path / f"part{suffix}").mkdir()
    with pytest.raises(OSError, match="part"):
        write_mesh(sample("triangle"), tmp_path / f"part{suffix}")
    assert [path.name for path in tmp_path.iterdir()] == [f"part{suffix}"]


def write_pair(path, **volumes):
    """Two unit cubes, glued, meshed with tetrahedra; `volumes` are the groups: name -> which of the two."""
    with gmsh_model("pair") as gmsh:
        cubes = [gmsh.model.occ.addBox(x, 0, 0, 1, 1, 1) for x in (0, 1)]
        gmsh.model.occ.fragment([(3, cubes[0])], [(3, cubes[1])])
        gmsh.model.occ.synchronize()
        for name, members in volumes.items():
            gmsh.model.addPhysicalGroup(3, [cubes[i] for i in members], name=name)
        faces = [(gmsh.model.occ.getCenterOfMass(*face), face[1]) for face in gmsh.model.getEntities(2)]
        gmsh.model.addPhysicalGroup(2, [tag for centre, tag in faces if abs(centre[2] - 1) < 1e-9], name="top")
        gmsh.model.addPhysicalGroup(2, [tag for centre, tag in faces if abs(centre[0] - 2) < 1e-9], name="right")
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
        gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)  # the version that other programs write most
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))


def test_a_file_of_two_volumes_makes_two_parts(tmp_path):
    path = tmp_path / "pair.msh"
    write_pair(path, brick=[0], mortar=[1])
    brick_part, mortar_part = read_parts(path, {"mortar": MORTAR, "brick": MATERIAL})
    assert (brick_part.name, brick_part.material, mortar_part.name, mortar_part.material) == ("brick", MATERIAL, "mortar", MORTAR)
    assert (set(brick_part.surfaces), set(mortar_part.surfaces)) == ({"top"}, {"top", "right"})
    for part, x in ((brick_part, 0), (mortar_part, 1)):
        assert cell_volumes(part.points, part.cells, "tetrahedron").sum() == pytest.approx(1)
        assert (part.points[:, 0].min(), part.points[:, 0].max()) == pytest.approx((x, x + 1))
        top = part.points[part.surfaces["top"]]
        areas = np.cross(top[:, 1] - top[:, 0], top[:, 2] - top[:, 0]) / 2
        assert areas.sum(axis=0) == pytest.approx([0, 0, 1], abs=1e-12)
    assert np.array_equal(read_mesh(path, MORTAR, volume="mortar").points, mortar_part.points)


def test_volumes_and_materials_must_agree(tmp_path):
    path = tmp_path / "pair.msh"
    write_pair(path, brick=[0], mortar=[1])
    with pytest.raises(InputError, match="expected materials for the volumes 'brick', 'mortar', got them for 'brick'"):
        read_parts(path, {"brick": MATERIAL})
    with pytest.raises(InputError, match=r"expected one volume or an argument volume="):
        read_mesh(path, MATERIAL)


def test_volumes_that_share_cells_are_refused_as_parts_but_can_be_read_alone(tmp_path):
    path = tmp_path / "pair.vtu"
    cells = [("quad", TWO_QUADS)]
    meshio.Mesh(SQUARES, cells, cell_data={"surface:all": [np.array([1, 1])], "surface:left": [np.array([1, 0])]}).write(path)
    with pytest.raises(InputError, match="expected each element once, got 1 repeated"):
        read_parts(path, {"all": MATERIAL, "left": MATERIAL})
    assert len(read_mesh(path, MATERIAL, volume="all").cells) == 2


def test_cells_in_no_volume_are_not_dropped_silently(tmp_path):
    path = tmp_path / "tagged.vtu"
    meshio.Mesh(SQUARES, [("quad", TWO_QUADS)], cell_data={"gmsh:physical": [np.array([7, 0])]}).write(path)
    with pytest.raises(InputError, match="got the volumes '7' and 1 cells in no volume"):
        read_mesh(path, MATERIAL)
    with pytest.raises(InputError, match="got 1 cells that are in none"):
        read_parts(path, {"7": MATERIAL})
    part = read_mesh(path, MATERIAL, volume="7")
    assert part.points.tolist() == [[0, 0], [1, 0], [0, 1], [1, 1]]  # the nodes of the other square are gone


def test_named_sets_and_tags_of_other_programs_become_surfaces(tmp_path):
    lines = np.array([(1, 0), (0, 3), (5, 2)])  # bottom, given inwards, left, right given inwards
    cells, none = [("quad", TWO_QUADS), ("line", lines)], np.array([], dtype=int)
    meshio.Mesh(SQUARES, cells, cell_sets={"foot": [none, np.array([0])], "ends": [none, np.array([1, 2])]}).write(tmp_path / "a.inp")
    meshio.Mesh(SQUARES, cells, cell_data={"medit:ref": [np.array([0, 0]), np.array([4, 5, 5])]}).write(tmp_path / "a.mesh")
    for name, (foot, ends) in {"a.inp": ("foot", "ends"), "a.mesh": ("4", "5")}.items():
        part = read_mesh(tmp_path / name, MATERIAL)
        assert set(part.surfaces) == {foot, ends}
        for facets, expected in ((part.surfaces[foot], [(0, -1)]), (part.surfaces[ends], [(-1, 0), (1, 0)])):
            t = part.points[facets[:, 1]] - part.points[facets[:, 0]]
            assert np.stack((t[:, 1], -t[:, 0]), axis=1) == pytest.approx(np.array(expected))  # outward normals


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        (
            [("quad", TWO_QUADS[:1]), ("triangle", np.array([(1, 2, 5), (1, 5, 4)]))],
            "cells of one type, got a mixture of quadrilateral and tri",
        ),
        ([("line", np.array([(0, 1)]))], "expected volume cells .* got none but line"),
        ([("wedge18", np.resize(np.arange(6), (1, 18)))], "expected cells of first or full second order .* got wedge18"),
        ([("quad8", np.array([(0, 1, 2, 3, 4, 5, 0, 1)]))], "got quad8: .*SecondOrderIncomplete"),
        ([("wedge", np.array([(0, 1, 2, 3, 4, 5)]))], "expected cells of first or full second order .* got wedge"),
        ([("quad", TWO_QUADS[:, ::-1])], "2 of them inverted"),
    ],
)
def test_meshes_that_cannot_be_used_are_refused(cells, message, tmp_path):
    path = tmp_path / "wrong.vtu"
    meshio.Mesh(SQUARES, cells).write(path)
    with pytest.raises(InputError, match=message):
        read_mesh(path, MATERIAL)


def test_a_surface_inside_the_mesh_is_refused(tmp_path):
    path = tmp_path / "cut.vtu"
    cells = [("quad", TWO_QUADS), ("line", np.array([(0, 1), (1, 4)]))]
    meshio.Mesh(SQUARES, cells, cell_data={"surface:cut": [np.array([0, 0]), np.array([1, 1])]}).write(path)
    with pytest.raises(
        InputError, match=r"cut\.vtu, surface 'cut': expected facets on the boundary.*got 1 of 2.*\[\[1.0, 0.0\], \[1.0, 1.0\]\]"
    ):
        read_mesh(path, MATERIAL)


def test_facets_of_the_wrong_shape_are_refused(tmp_path):
    path = tmp_path / "wrong.vtu"
    part = brick("b", (1, 1, 1), (1, 1, 1), MATERIAL)
    cells = [("hexahedron", part.cells), ("triangle", part.surfaces["x-"][:, :3])]
    meshio.Mesh(part.points, cells, cell_data={"surface:x-": [np.array([0]), np.array([1])]}).write(path)
    with pytest.raises(InputError, match="surface 'x-': expected quadrilateral facets on hexahedron cells, got triangle"):
        read_mesh(path, MATERIAL)


@pytest.mark.parametrize("name", ["absent.msh", "absent.vtu"])
def test_a_missing_file_is_refused(name, tmp_path):
    with pytest.raises(InputError, match=rf"{name}: expected a mesh file, got none"):
        read_mesh(tmp_path / name, MATERIAL)


def test_a_file_of_two_volumes_makes_one_bonded_part(tmp_path):
    path = tmp_path / "pair.msh"
    write_pair(path, brick=[0], mortar=[1])
    part = read_mesh(path, ByRegion({"mortar": MORTAR, "brick": MATERIAL}), name="both")
    assert (part.name, set(part.surfaces), set(part.regions)) == ("both", {"top", "right"}, {"brick", "mortar"})
    for name, x in (("brick", 0.5), ("mortar", 1.5)):
        assert cell_volumes(part.points, part.cells[part.regions[name]], "tetrahedron").sum() == pytest.approx(1)
        assert abs(part.points[part.cells[part.regions[name]]].mean(axis=1)[:, 0] - x).max() < 0.5
    top = part.points[part.surfaces["top"]]
    assert (np.cross(top[:, 1] - top[:, 0], top[:, 2] - top[:, 0]) / 2).sum(axis=0) == pytest.approx([0, 0, 2], abs=1e-12)
    with pytest.raises(InputError, match="expected materials for the volumes 'brick', 'mortar', got them for 'brick'"):
        read_mesh(path, ByRegion({"brick": MATERIAL}))


@pytest.mark.parametrize("order", [1, 2])
def test_physical_groups_of_points_and_lines_name_nodes(order, tmp_path):
    """A box with a named corner and a named edge: as nodes of the part, raised with it, and written again."""
    with gmsh_model("box") as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        for dimension, name, low, high in (
            (0, "tip", (1, 1, 1), (1, 1, 1)),
            (1, "ridge", (0, 0, 1), (1, 0, 1)),
            (3, "box", (0,) * 3, (1,) * 3),
        ):
            reach = [c - 1e-3 for c in low], [c + 1e-3 for c in high]
            tags = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*reach[0], *reach[1], dimension)]
            gmsh.model.addPhysicalGroup(dimension, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(tmp_path / "box.msh"))
    part = read_mesh(tmp_path / "box.msh", MATERIAL, elements="P2")
    ridge = part.points[np.unique(part.nodes["ridge"])]
    assert part.nodes["tip"].shape == (1,)
    assert np.allclose(part.points[part.nodes["tip"]], 1.0)
    lines = len(part.nodes["ridge"])
    assert lines >= 2
    assert part.nodes["ridge"].shape == (lines, 3)
    assert np.allclose(ridge[:, 1:], [0, 1])
    assert np.allclose(np.sort(ridge[:, 0]), np.linspace(0, 1, 2 * lines + 1))
    write_mesh(part, tmp_path / "again.msh")
    again = read_mesh(tmp_path / "again.msh", MATERIAL)
    assert all(np.array_equal(again.nodes[name], part.nodes[name]) for name in ("tip", "ridge"))
    assert np.array_equal(again.points, part.points)
