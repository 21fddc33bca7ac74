"""Surfaces from files: good ones give the mass that formulas say, broken ones are repaired or refused with the reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.solids.closed_surface import closed_surface
from fcsim.mesh.solids.self_intersection import crossing_triangles
from fcsim.mesh.solids.surface_file import read_surfaces

trimesh = pytest.importorskip("trimesh")
pytestmark = pytest.mark.usefixtures("read_here")

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def shape(name: str):  # type: ignore[no-untyped-def]
    """A solid of trimesh's and its volume by formula (of its facets where it is round)."""
    make = trimesh.creation
    if name == "box":
        return make.box((1.0, 2.0, 0.5)), 1.0
    if name == "cylinder":
        return make.cylinder(0.5, 2.0, sections=24), 2.0 * 0.5 * 24 * 0.25 * np.sin(2 * np.pi / 24)
    if name == "ring":
        return make.annulus(0.5, 1.0, 0.7, sections=32), 0.7 * 0.5 * 32 * (1.0 - 0.25) * np.sin(2 * np.pi / 32)
    if name == "ball":
        ball = make.icosphere(subdivisions=2)
        return ball, abs(np.linalg.det(ball.vertices[ball.faces]).sum() / 6)
    return trimesh.Trimesh(TETRAHEDRON, FACES), 1 / 6


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb", "3mf"])
@pytest.mark.parametrize("name", ["box", "cylinder", "ring", "ball", "tetrahedron"])
def test_solids_of_every_format(name: str, suffix: str, tmp_path: Path) -> None:
    if suffix == "3mf":
        pytest.importorskip("lxml")
    mesh, volume = shape(name)
    mesh.export(tmp_path / f"solid.{suffix}")
    (surface,) = read_surfaces(tmp_path / f"solid.{suffix}")
    assert surface.moments()[0] == pytest.approx(volume, rel=1e-5)  # STL and GLB hold single precision


def test_closed_groups_are_solids_of_their_names_too_but_sides_are_none(tmp_path: Path) -> None:
    """As of programs that write `g` alone, here with corners counted from the last and the faces of two groups in turns; where groups are
    the faces of one solid it stays one."""
    corners = [(x + shift, y, z) for shift in (0.0, 5.0) for x, y, z in TETRAHEDRON]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    for face in FACES:
        text += "".join(f"g {name}\nf " + " ".join(str(k - back) for k in face) + "\n" for name, back in (("pier", 8), ("left lintel", 4)))
    (tmp_path / "two.obj").write_text(text)
    pier, lintel = sorted(read_surfaces(tmp_path / "two.obj"), key=lambda surface: float(surface.points[:, 0].max()))
    assert (pier.name, lintel.name) == ("pier", "left lintel")
    assert lintel.moments()[0] == pytest.approx(pier.moments()[0])
    sides = "".join(f"v {x} {y} {z}\n" for x, y, z in TETRAHEDRON)
    sides += "".join(f"g side {k}\nf " + " ".join(str(k + 1) for k in face) + "\n" for k, face in enumerate(FACES))
    (tmp_path / "one.obj").write_text(sides)
    assert len(read_surfaces(tmp_path / "one.obj")) == 1


def test_objects_are_solids_of_their_names_and_pieces_are_numbered(tmp_path: Path) -> None:
    text, base = "", 0
    for name, shift in (("pier", 0.0), ("lintel", 5.0)):
        text += f"o {name}\n" + "".join(f"v {x + shift} {y} {z}\n" for x, y, z in TETRAHEDRON)
        text += "".join("f " + " ".join(str(k + 1 + base) for k in face) + "\n" for face in FACES)
        base += 4
    (tmp_path / "two.obj").write_text(text)
    assert sorted(surface.name for surface in read_surfaces(tmp_path / "two.obj")) == ["lintel", "pier"]
    both = trimesh.util.concatenate([shape("box")[0], shape("box")[0].copy().apply_translation((0.0, 0.0, 0.5))])
    both.export(tmp_path / "stack.stl")
    pieces = read_surfaces(tmp_path / "stack.stl")
    assert [piece.moments()[0] for piece in pieces] == pytest.approx([1.0, 1.0], rel=1e-5)  # though their corners and edges are the same


def test_a_wall_in_one_stl_is_split_into_its_blocks(tmp_path: Path) -> None:
    """Three courses of three, of one size: faces, edges and corners of neighbours coincide."""
    blocks = [trimesh.creation.box((0.4, 0.2, 0.1)) for _ in range(9)]
    for k, block in enumerate(blocks):
        block.apply_translation((0.4 * (k % 3), 0.0, 0.1 * (k // 3)))
    trimesh.util.concatenate(blocks).export(tmp_path / "wall.stl")
    pieces = read_surfaces(tmp_path / "wall.stl")
    assert [piece.moments()[0] for piece in pieces] == pytest.approx([0.4 * 0.2 * 0.1] * 9, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("hole", "closed surface, got 3 edges of one face alone"),
        ("flap", "edges of two faces|closed surface"),
        ("millimetres", "solids in m, got one of 2000 m; scale=1e-3"),
        ("crossing", "cross each other"),
        ("cavity", "inside .*: a cavity"),
        ("flat", "area|volume|triangles|closed"),
        ("empty", "triangles"),
        ("noise", "trimesh can read|triangles"),
        ("nan", "finite"),
    ],
)
def test_broken_surfaces_are_refused_with_the_reason(change: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "solid.off"
    mesh = shape("box")[0]
    points, faces = np.array(mesh.vertices), np.array(mesh.faces)
    if change == "hole":
        faces = faces[:-1]
    elif change == "flap":
        points, faces = np.vstack([points, [[5.0, 5, 5]]]), np.vstack([faces, [faces[0, 0], faces[0, 1], len(points)]])
    elif change == "millimetres":
        points = points * 1000
    elif change == "crossing":  # a corner pushed through the face opposite to it
        points = np.vstack([TETRAHEDRON, [[0.1, 0.1, -0.3]]])
        faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 4], [2, 3, 4], [3, 1, 4]])
    elif change == "cavity":
        faces, points = np.vstack([faces, faces[:, ::-1] + 8]), np.vstack([points, 0.5 * points])
    elif change == "flat":
        points = points * [1, 1, 0]
    elif change == "empty":
        faces = faces[:0]
    lines = [" ".join(map(repr, point)) for point in points.tolist()] + ["3 " + " ".join(map(str, face)) for face in faces.tolist()]
    if change == "nan":
        lines[0] = "nan 0 0"
    path.write_text("rubbish" if change == "noise" else "\n".join(["OFF", f"{len(points)} {len(faces)} 0", *lines]) + "\n")
    with pytest.raises(InputError, match=message) as error:
        read_surfaces(path)
    assert "solid.off" in str(error.value)


@pytest.mark.parametrize("change", ["inside out", "one face inwards", "face twice", "needle"])
def test_slips_are_repaired(change: str, tmp_path: Path) -> None:
    mesh, volume = shape("box")
    points, faces = np.array(mesh.vertices), np.array(mesh.faces)
    if change == "inside out":
        faces = faces[:, ::-1]
    elif change == "one face inwards":
        faces[3] = faces[3, ::-1]
    elif change == "face twice":
        faces = np.vstack([faces, faces[2]])
    else:
        faces = np.vstack([faces, [0, 1, 1]])
    lines = [" ".join(map(repr, point)) for point in points.tolist()] + ["3 " + " ".join(map(str, face)) for face in faces.tolist()]
    (tmp_path / "box.off").write_text("\n".join(["OFF", f"{len(points)} {len(faces)} 0", *lines]) + "\n")
    (surface,) = read_surfaces(tmp_path / "box.off")
    assert surface.moments()[0] == pytest.approx(volume)


def test_units_are_said(tmp_path: Path) -> None:
    shape("box")[0].copy().apply_scale(1000.0).export(tmp_path / "mm.stl")
    (surface,) = read_surfaces(tmp_path / "mm.stl", scale=1e-3)
    assert surface.moments()[0] == pytest.approx(1.0, rel=1e-5)
    with pytest.raises(InputError, match="factor > 0"):
        read_surfaces(tmp_path / "mm.stl", scale=-1.0)


def test_formats_and_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="surface file"):
        read_surfaces(tmp_path / "solid.step")
    with pytest.raises(InputError, match="found none"):
        read_surfaces(tmp_path / "solid.stl")


def test_a_surface_crosses_itself_where_it_is_pushed_through() -> None:
    """A tetrahedron's corner through the opposite face: the three edges there pierce it."""
    good = closed_surface("t", TETRAHEDRON, FACES)
    assert len(crossing_triangles(good.points, good.triangles)) == 0
    points = np.vstack([TETRAHEDRON, [[0.2, 0.2, 0.2]]])
    refined = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 4], [2, 3, 4], [3, 1, 4]])
    assert len(crossing_triangles(points, refined)) == 0
    points[4] = [0.1, 0.1, -0.3]  # through the base
    assert len(crossing_triangles(points, refined)) >= 2


def test_corners_without_z_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"a\.obj"):
        read_surfaces(tmp_path / "a.obj")
