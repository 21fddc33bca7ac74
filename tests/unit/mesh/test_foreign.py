"""Mesh files that would end, hang or fill the process that reads them."""

import sys
from pathlib import Path

import numpy as np
import pytest

from fcsim.apart import reading as apart
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick
from fcsim.mesh.foreign import read_foreign
from fcsim.mesh.io import read_mesh, write_mesh
from fcsim.mesh.material import Material
from fcsim.mesh.named_mesh import Block, named_mesh

STONE = Material(1e9, 0.2, 2000.0)
FAULTS = Path(__file__).parents[2] / "faults" / "data"


@pytest.mark.parametrize("path", sorted(FAULTS.glob("*.msh")), ids=lambda path: path.stem)
def test_a_file_that_crashes_gmsh_is_an_error(path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a mesh file, got one that ends its reader \(SIGSEGV\)"):
        read_mesh(path, STONE)


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
