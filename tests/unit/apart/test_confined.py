"""Meshes and surfaces of others bring in nothing but themselves: no programs, no files of elsewhere."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import h5py
import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.blocks import brick
from fcsim.mesh.io import read_mesh, write_mesh
from fcsim.mesh.material import Material
from fcsim.mesh.solids.surface_file import read_surfaces

STONE = Material(1e9, 0.2, 2000.0)
pytestmark = pytest.mark.usefixtures("read_here")  # what is refused is refused before a library reads, in whatever process


def script(marker: Path) -> str:
    """What gmsh runs where it takes a file for a script."""
    return f'SystemCall "touch {marker}";\nPrintf("x") > "{marker}.too";\n'


@pytest.mark.parametrize(
    "head",
    [
        "",
        "\n",
        "$PhysicalNames\n",
        "$View\n",
        " $MeshFormat\n",
        "// ",
        "$MESHFORMAT\n",
    ],
)
def test_a_script_that_is_named_as_a_mesh_is_not_run(tmp_path: Path, head: str) -> None:
    path, marker = tmp_path / "a.msh", tmp_path / "ran"
    path.write_text(head + "\n" + script(marker))
    with pytest.raises(InputError, match=r"a\.msh: expected a mesh that gmsh can read"):
        read_mesh(path, STONE)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.msh"]


def test_options_beside_a_mesh_are_not_run(tmp_path: Path) -> None:
    path, marker = tmp_path / "a.msh", tmp_path / "ran"
    write_mesh(brick("block", (1, 1, 1), (1, 1, 1), STONE), path)
    (tmp_path / "a.msh.opt").write_text(script(marker))
    assert len(read_mesh(path, STONE).points) == 8
    assert not list(tmp_path.glob("ran*"))


def test_a_mesh_that_is_a_link_is_read(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    write_mesh(brick("block", (1, 1, 1), (1, 1, 1), STONE), tmp_path / "far" / "a.msh")
    (tmp_path / "b.msh").symlink_to(tmp_path / "far" / "a.msh")
    assert len(read_mesh(tmp_path / "b.msh", STONE).points) == 8


XDMF = """<Xdmf Version="3.0"><Domain><Grid Name="Grid">
<Geometry GeometryType="XYZ"><DataItem DataType="Float" Dimensions="4 3" Format="{kind}" Precision="8">{place}</DataItem></Geometry>
<Topology TopologyType="Tetrahedron" NumberOfElements="1"><DataItem DataType="Int" Dimensions="1 4" Format="XML" Precision="8">0 1 2 3
</DataItem></Topology></Grid></Domain></Xdmf>"""
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """Numbers of others that would make a mesh, in tmp_path/secret.*; the folder of the mesh file."""
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["x"] = CORNERS
    CORNERS.tofile(tmp_path / "secret.bin")
    folder = tmp_path / "mesh"
    folder.mkdir()
    return folder


@pytest.mark.parametrize("kind", ["HDF up", "HDF absolute", "HDF link", "Binary"])
def test_xdmf_takes_nothing_from_other_folders(elsewhere: Path, kind: str) -> None:
    above = elsewhere.parent
    place = {
        "HDF up": "../secret.h5:/x",
        "HDF absolute": f"{above}/secret.h5:/x",
        "HDF link": "link.h5:/x",
        "Binary": f"{above}/secret.bin",
    }[kind]
    (elsewhere / "link.h5").symlink_to(above / "secret.h5")
    (elsewhere / "a.xdmf").write_text(XDMF.format(kind=kind.split()[0], place=place))
    with pytest.raises(InputError, match=r"a\.xdmf: .*expected a place within .*mesh, it leads to .*secret"):
        read_mesh(elsewhere / "a.xdmf", STONE)


@pytest.mark.parametrize("kind", ["link", "storage", "virtual"])
def test_hdf5_beside_a_mesh_holds_its_data_itself(elsewhere: Path, kind: str) -> None:
    above = elsewhere.parent
    with h5py.File(elsewhere / "a.h5", "w") as file:
        if kind == "link":
            file["x"] = h5py.ExternalLink(str(above / "secret.h5"), "/x")
        elif kind == "storage":
            file.create_dataset("x", shape=(4, 3), dtype="f8", external=[(str(above / "secret.bin"), 0, 96)])
        else:
            layout = h5py.VirtualLayout(shape=(4, 3), dtype="f8")
            layout[:] = h5py.VirtualSource(str(above / "secret.h5"), "x", shape=(4, 3))
            file.create_virtual_dataset("x", layout)
    (elsewhere / "a.xdmf").write_text(XDMF.format(kind="HDF", place="a.h5:/x"))
    with pytest.raises(InputError, match=r"a\.h5, /x: expected data in this file"):
        read_mesh(elsewhere / "a.xdmf", STONE)


def test_xdmf_with_its_own_data_is_read(elsewhere: Path) -> None:
    with h5py.File(elsewhere / "a.h5", "w") as file:
        file["x"] = CORNERS
        file["circle"] = file["/"]
    (elsewhere / "a.xdmf").write_text(XDMF.format(kind="HDF", place="a.h5:/x"))
    assert np.array_equal(read_mesh(elsewhere / "a.xdmf", STONE).points, CORNERS)


def glb(document: dict[str, object]) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<II", 2, 20 + len(text)) + struct.pack("<I4s", len(text), b"JSON") + text


def test_surfaces_take_nothing_from_other_files(tmp_path: Path) -> None:
    """A GLB whose corners are a file beside it; an OBJ with materials of elsewhere is read without them, under its objects' names."""
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.uint32)
    content = CORNERS.astype(np.float32).tobytes() + triangles.tobytes()
    (tmp_path / "secret.bin").write_bytes(content)
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 48}]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"},
    ]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"uri": "secret.bin", "byteLength": len(content)}],
    }
    (tmp_path / "a.glb").write_bytes(glb(document))
    with pytest.raises(InputError, match=r"a\.glb: expected a surface that trimesh can read"):
        read_surfaces(tmp_path / "a.glb")
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS.tolist())
    faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles.tolist())
    (tmp_path / "a.obj").write_text(f"mtllib ../../etc/passwd\no pier\n{corners}usemtl x\n{faces}")
    assert [surface.name for surface in read_surfaces(tmp_path / "a.obj")] == ["pier"]
