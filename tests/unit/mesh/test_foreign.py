"""Mesh files that would end, hang or fill the process that reads them."""

import sys
import tempfile
from pathlib import Path

import meshio
import numpy as np
import pytest

from fcsim.apart import reading as apart
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.foreign import read_foreign
from fcsim.mesh.io import read_mesh, write_mesh
from fcsim.mesh.material import Material
from fcsim.mesh.named_mesh import Block, named_mesh
from fcsim.mesh.solids.surface_file import read_surfaces

STONE = Material(1e9, 0.2, 2000.0)
FAULTS = Path(__file__).parents[2] / "faults" / "data"


@pytest.mark.parametrize("path", sorted(FAULTS.glob("*.msh")), ids=lambda path: path.stem)
def test_a_file_that_crashes_gmsh_is_an_error(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with pytest.raises(InputError, match=r"expected a mesh file, got one that ends its reader \(SIGSEGV\)"):
        read_mesh(path, STONE)
    assert not list(tmp_path.iterdir()), "the reader that crashed left files"


def test_a_reader_that_hangs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.msh").write_text("x")
    monkeypatch.setattr(apart, "PROCESS", "import time; time.sleep(60)")
    monkeypatch.setattr(apart, "SECONDS", 0.3)
    with pytest.raises(InputError, match="expected a mesh that can be read in 0 s, its reader was still at it"):
        read_foreign(tmp_path / "a.msh", "strain", 1.0)


def test_a_reader_that_fills_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit on addresses that the process sets itself holds."""
    (tmp_path / "a.msh").write_text("x")
    greedy = "import sys; from fcsim.mesh import foreign; foreign._read = lambda *a: bytearray(2**40); "
    monkeypatch.setattr(apart, "PROCESS", greedy + "raise SystemExit(foreign.main(*sys.argv[1:]))")
    with pytest.raises(InputError, match=r"expected a mesh that fits into 4\.0 GiB"):
        read_foreign(tmp_path / "a.msh", "strain", 1.0)


def test_the_mesh_comes_through_whole(tmp_path: Path) -> None:
    """Every digit of the nodes, all cells and surfaces, the signs of zeros aside."""
    part = brick("block", (0.2, 0.1, 0.3), (2, 1, 3), STONE)
    for name in ("a.msh", "a.vtu"):
        write_mesh(part, tmp_path / name)
        read = read_mesh(tmp_path / name, STONE)
        np.testing.assert_array_equal(read.points, part.points)
        np.testing.assert_array_equal(read.cells, part.cells)
        assert {k: len(v) for k, v in read.surfaces.items()} == {k: len(v) for k, v in part.surfaces.items()}


@pytest.mark.parametrize(
    "name", ["broken.msh", *(pytest.param(name, marks=pytest.mark.slow) for name in ("broken.vtu", "broken.xdmf")), "broken.foo"]
)
def test_a_broken_file_is_refused_and_the_next_read_works(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / name).write_text("$MeshFormat\nnonsense\n")
    with pytest.raises(InputError, match=name):
        read_mesh(tmp_path / name, STONE)
    assert capfd.readouterr().out == ""
    write_mesh(rectangle("plate", (1, 2), (2, 3), STONE, "triangle"), tmp_path / "good.msh")
    assert len(read_mesh(tmp_path / "good.msh", STONE).cells) == 12


def test_a_surface_comes_through_whole_and_so_does_what_is_wrong(tmp_path: Path) -> None:
    """Corners of all digits by name from the process that reads; a file's fault is what that process says it is."""
    pytest.importorskip("trimesh")
    points = np.array([[0.1, 1 / 3, 0.2], [1.1, 1 / 3, 0.2], [0.1, np.sqrt(2), 0.2], [0.1, 1 / 3, np.pi]])
    corners = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    (tmp_path / "a.obj").write_text(f"o pier\n{corners}f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    (surface,) = read_surfaces(tmp_path / "a.obj")
    assert surface.name == "pier" and sorted(surface.points.tolist()) == sorted(points.tolist())
    assert surface.moments()[0] == pytest.approx(abs(np.linalg.det(points[1:] - points[0])) / 6, rel=1e-12)
    (tmp_path / "b.off").write_text("rubbish\n")
    with pytest.raises(InputError, match=r"b\.off: expected a surface that trimesh can read"):
        read_surfaces(tmp_path / "b.off")


@pytest.mark.parametrize("elements", [[[0, 1, 2, 9]], [[0, 1, 2, -1]], [[0, 1, 2, 2**62]]])
def test_elements_of_nodes_that_are_not_there(elements: list[list[int]]) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    with pytest.raises(InputError, match="expected tetrahedron elements of the nodes 0 to 3"):
        named_mesh("a file", points, [Block("tetrahedron", np.array(elements))])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_coordinates_that_are_none(value: float) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, value]])
    with pytest.raises(InputError, match="expected finite coordinates"):
        named_mesh("a file", points, [Block("tetrahedron", np.array([[0, 1, 2, 3]]))])


@pytest.mark.skipif(sys.platform != "linux", reason="limits on addresses")
def test_group_names_that_are_no_text(tmp_path: Path) -> None:
    """A physical name in Latin-1."""
    part = brick("block", (0.2, 0.1, 0.3), (1, 1, 1), STONE)
    write_mesh(part, tmp_path / "a.msh")
    damaged = (tmp_path / "a.msh").read_bytes().replace(b'"block"', b'"bl\xf6ck"')
    (tmp_path / "b.msh").write_bytes(damaged)
    with pytest.raises(InputError, match=r"b\.msh: expected a mesh that gmsh can read"):
        read_mesh(tmp_path / "b.msh", STONE)


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("entities", [False, True])
def test_what_meshio_leaves_out_of_its_files_of_gmsh_is_said(entities: bool, binary: bool, tmp_path: Path) -> None:
    """Two cubes in two physical groups: MSH 4.1 of meshio has the groups' names and no word of whose they are; gmsh read one part without
    a name, or refused an "unknown entity". As MSH 2.2 they come."""
    layer = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    points = [(x, y, z) for z in (0.0, 1.0, 2.0) for x, y in layer]
    data = {"gmsh:physical": [np.array([1, 2])]} | ({"gmsh:geometrical": [np.array([1, 2])]} if entities else {})
    names = {"low": np.array([1, 3]), "high": np.array([2, 3])}
    cells = np.arange(8) + np.array([[0], [4]])
    mesh = meshio.Mesh(points, [("hexahedron", cells)], cell_data=data, field_data=names)
    meshio.write(tmp_path / "new.msh", mesh, file_format="gmsh", binary=binary)
    with pytest.raises(InputError, match=r"expected physical groups by the .Entities of the file, got their names alone: .*gmsh22"):
        read_foreign(tmp_path / "new.msh", "strain", 1.0)
    meshio.write(tmp_path / "old.msh", mesh, file_format="gmsh22", binary=binary)
    if entities:  # else meshio puts both into one entity, and gmsh each group on all of it
        found = read_foreign(tmp_path / "old.msh", "strain", 1.0).volumes
        assert {name: len(cells) for name, cells in found.items()} == {"low": 1, "high": 1}
