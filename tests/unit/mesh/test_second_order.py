"""Meshes of second order: raised, made by gmsh, written and read, and the linear pieces of their facets."""

from dataclasses import replace

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh import (
    Body,
    Material,
    Part,
    brick,
    mass_properties,
    part_from_gmsh,
    read_mesh,
    read_parts,
    rectangle,
    rigid_body,
    write_mesh,
)
from fcsim.mesh.cell_type import CELL_TYPES, ELEMENTS, RAISED
from fcsim.mesh.facets import match_facets
from fcsim.mesh.quality import cell_volumes, check_quality
from fcsim.runtime import gmsh_model

pytestmark = pytest.mark.usefixtures("read_here")

STEEL = Material(2e11, 0.3, 7800.0)
cells = pytest.mark.parametrize("cell", list(RAISED))


def box(cell: str, divisions: int = 2, **options: object) -> Part:
    if CELL_TYPES[cell].dimension == 3:
        return brick("box", (1.0, 2.0, 3.0), (divisions,) * 3, STEEL, cell, **options)
    return rectangle("box", (1.0, 2.0), (divisions,) * 2, STEEL, cell, **options)


@cells
def test_a_raised_part_keeps_its_shape_and_its_nodes(cell: str) -> None:
    first = box(cell)
    second = replace(first, elements=ELEMENTS[RAISED[cell]][0])
    kind = CELL_TYPES[second.cell_type]
    assert second.cell_type == RAISED[cell]
    assert np.array_equal(second.points[: len(first.points)], first.points)
    assert np.array_equal(second.cells[:, : kind.corners], first.cells)
    assert len(np.unique(np.round(second.points, 12), axis=0)) == len(second.points)
    for place, corners in enumerate(kind.middles, kind.corners):
        assert np.allclose(second.points[second.cells[:, place]], second.points[second.cells[:, corners]].mean(axis=1))
    for name, facets in second.surfaces.items():
        count, oriented = match_facets(second.cells, second.cell_type, facets)
        assert np.all(count == 1) and np.array_equal(oriented, facets), name
        assert np.ptp(second.points[facets][..., "xyz".index(name[0])]) < 1e-14
    assert cell_volumes(second.points, second.cells, second.cell_type).sum() == pytest.approx(2 * 3 ** (kind.dimension - 2))
    assert np.allclose(check_quality(second), check_quality(first).min(), rtol=0.5)
    for a, b in zip(mass_properties(first), mass_properties(second), strict=True):
        assert np.allclose(a, b)


@cells
def test_a_facet_comes_back_from_its_first_corner(cell: str) -> None:
    """Turned round, reversed or not: the facet outwards that begins at the given first node, its middles with it."""
    part = box(cell, elements=ELEMENTS[RAISED[cell]][0])
    kind = CELL_TYPES[part.cell_type]
    k = kind.facet_corners
    for facets in part.surfaces.values():
        if k == 2:
            assert np.array_equal(match_facets(part.cells, part.cell_type, facets[:, [1, 0, 2]])[1], facets)
            continue
        turned = facets.copy()
        turned[:, :k], turned[:, k : 2 * k] = np.roll(facets[:, :k], -1, axis=1), np.roll(facets[:, k : 2 * k], -1, axis=1)
        assert np.array_equal(match_facets(part.cells, part.cell_type, turned)[1], turned)
        reverse = [0, *range(k - 1, 0, -1)], [*range(2 * k - 1, k - 1, -1)]
        inside_out = turned.copy()
        inside_out[:, :k], inside_out[:, k : 2 * k] = turned[:, reverse[0]], turned[:, reverse[1]]
        assert np.array_equal(match_facets(part.cells, part.cell_type, inside_out)[1], turned)


@cells
@pytest.mark.parametrize("extension", ["msh", "vtu", "vtk"])
def test_files_hold_parts_of_second_order(cell: str, extension: str, tmp_path) -> None:
    part = box(cell, elements=ELEMENTS[RAISED[cell]][0])
    write_mesh(part, tmp_path / f"part.{extension}")
    read = read_mesh(tmp_path / f"part.{extension}", STEEL)
    assert (read.cell_type, read.elements) == (part.cell_type, part.elements)
    assert np.array_equal(read.points, part.points) and np.array_equal(read.cells, part.cells)
    assert {name: facets.tolist() for name, facets in read.surfaces.items()} == {
        name: facets.tolist() for name, facets in part.surfaces.items()
    }
    if extension != "msh":
        pyvista = pytest.importorskip("pyvista")
        grid = pyvista.read(tmp_path / f"part.{extension}")
        solid = grid.extract_cells(grid.celltypes == CELL_TYPES[part.cell_type].vtk)
        sizes = solid.compute_cell_sizes()
        assert sizes["Volume" if part.dimension == 3 else "Area"].sum() == pytest.approx(2 * 3 ** (part.dimension - 2))


def test_formats_that_cannot_hold_second_order_are_refused(tmp_path) -> None:
    part = box("tetrahedron", elements="P2")
    with pytest.raises(InputError, match=r"expected \.msh, \.vtu, \.vtk for cells of second order, got '\.xdmf'"):
        write_mesh(part, tmp_path / "part.xdmf")


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_gmsh_follows_a_curved_boundary(cell: str, tmp_path) -> None:
    """A quarter of a cylinder by gmsh, of second order: the volume is pi / 4 to 1e-3 where chords are off by 2 %; two groups, one file."""
    with gmsh_model("quarter") as gmsh:
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        o, a, b = (gmsh.model.occ.addPoint(*p, 0) for p in ((0, 0), (1, 0), (0, 1)))
        loop = gmsh.model.occ.addCurveLoop(
            [gmsh.model.occ.addLine(o, a), gmsh.model.occ.addCircleArc(a, o, b), gmsh.model.occ.addLine(b, o)]
        )
        face = gmsh.model.occ.addPlaneSurface([loop])
        out = gmsh.model.occ.extrude([(2, face)], 0, 0, 1, numElements=[2], recombine=cell == "hexahedron")
        gmsh.model.occ.synchronize()
        if cell == "hexahedron":
            gmsh.model.mesh.setRecombine(2, face)
            gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 2)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        gmsh.model.addPhysicalGroup(3, [out[1][1]], name="quarter")
        gmsh.model.addPhysicalGroup(2, [face], name="bottom")
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "quarter.msh"))
        part = part_from_gmsh(gmsh, "quarter", STEEL)
    assert part.cell_type == RAISED[cell]
    assert cell_volumes(part.points, part.cells, part.cell_type).sum() == pytest.approx(np.pi / 4, rel=1e-3)
    (read,) = read_parts(tmp_path / "quarter.msh", {"quarter": STEEL})
    assert np.array_equal(read.cells, part.cells) and np.array_equal(read.surfaces["bottom"], part.surfaces["bottom"])
    assert mass_properties(part).centre[:2] == pytest.approx([4 / (3 * np.pi)] * 2, rel=1e-3)
    rigid = rigid_body(Body("rigid", part))
    assert rigid.surfaces["bottom"].shape[1] == CELL_TYPES[cell].facet_size
    assert len(rigid.surfaces["bottom"]) == 4 * len(part.surfaces["bottom"])


def test_incomplete_second_order_is_refused_with_what_to_set() -> None:
    with gmsh_model("box") as gmsh:
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        with pytest.raises(InputError, match=r"got .*Quadrilateral 8.*SecondOrderIncomplete = 0"):
            part_from_gmsh(gmsh, "box", STEEL)


def test_surfaces_that_are_not_of_the_cells_are_refused_when_raised() -> None:
    part = box("hexahedron")
    with pytest.raises(InputError, match="surface 'wrong': expected facets of the part's cells"):
        replace(part, surfaces={"wrong": np.array([[0, 1, 2, 3]])}, elements="Q2")
    with pytest.raises(InputError, match=r"expected 'Q1' or .*'Q2' for hexahedron cells, got 'P2'"):
        replace(part, elements="P2")


@cells
def test_inverted_cells_of_second_order_are_found(cell: str) -> None:
    """A middle node drawn over more than a quarter of its edge makes the Jacobian negative there."""
    part = box(cell, elements=ELEMENTS[RAISED[cell]][0])
    points = part.points.copy()
    edge = part.cells[0, [0, 1, CELL_TYPES[part.cell_type].corners]]
    points[edge[2]] = 0.1 * points[edge[0]] + 0.9 * points[edge[1]]
    with pytest.raises(InputError, match="scaled Jacobian"):
        check_quality(replace(part, points=points))
