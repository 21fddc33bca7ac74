"""Models of COMPAS: what is read of the records that its packages write, and what is refused. The records are written out by hand."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.masonry import analyse, read_model
from fcsim.masonry.compas_json import face_area, plane_faces

CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
FACES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


def record(dtype: str, *inheritance: str, **data: Any) -> dict[str, Any]:
    return {"dtype": dtype, "data": data, "inheritance": list(inheritance), "guid": "0"}


def mesh(low: tuple[float, ...], size: tuple[float, ...], dtype: str = "compas.datastructures/Mesh", *inheritance: str) -> dict[str, Any]:
    """A box whose vertices and faces have keys that are no row of numbers, and leave out coordinates of the default."""
    places = [{c: low[k] + size[k] * p[k] for k, c in enumerate("xyz") if low[k] + size[k] * p[k] != 0} for p in CORNERS]
    return record(
        dtype,
        *inheritance,
        default_vertex_attributes={"x": 0.0, "y": 0.0, "z": 0.0},
        vertex={str(3 * k + 2): place for k, place in enumerate(places)},
        face={str(5 * k): [3 * v + 2 for v in face] for k, face in enumerate(FACES)},
    )


def matrix(rotation: float = 0.0, shift: tuple[float, float, float] = (0, 0, 0)) -> dict[str, Any]:
    c, s = math.cos(rotation), math.sin(rotation)
    rows = [[c, -s, 0, shift[0]], [s, c, 0, shift[1]], [0, 0, 1, shift[2]], [0, 0, 0, 1]]
    return record("compas.geometry/Transformation", matrix=rows)


def model(*blocks: tuple[dict[str, Any], bool], transformation: object = None, inside: object = None) -> dict[str, Any]:
    """A BlockModel of meshes; `inside`: the transformation of a group that holds them all."""
    elements: dict[str, Any] = {"g": record("compas_model.elements/Group", transformation=inside, features=[], material=None)}
    for k, (geometry, support) in enumerate(blocks):
        elements[f"e{k}"] = record(
            "compas_dem.elements/Block",
            "compas_model.elements/Element",
            transformation=transformation,
            features=[],
            material="m",
            geometry=geometry,
            is_support=support,
        )
    children = [{"name": "n", "element": f"e{k}"} for k in range(len(blocks))]
    return record(
        "compas_dem.models/BlockModel",
        "compas_model.models/Model",
        transformation=None,
        elements=elements,
        materials={"m": record("compas_dem.material/Stone", density=2200, Ecm=20000)},
        tree={"root": {"name": "root", "children": [{"name": "n", "element": "g", "children": children}]}},
        graph={"node": {"0": {"element": "g"}} | {str(k + 1): {"element": f"e{k}"} for k in range(len(blocks))}},
    )


def posed(structure: dict[str, Any], *groups: dict[str, Any], mu: float = 0.7, **law: Any) -> dict[str, Any]:
    """An analysis of one problem."""
    coulomb = record("compas_dem.interactions/MohrCoulomb", phi=math.degrees(math.atan(mu)), mu=mu, **({"c": None, "t_c": None} | law))
    properties = record("compas_dem.interactions/ContactProperties", contact_model=coulomb, joint_model=None)
    problem = record("compas_dem.problem/Problem", name="push", boundary_conditions=list(groups), contact_properties=properties)
    return record("compas_dem.models/Analysis", model=structure, problems=[problem])


def group(**loads: list[Any]) -> dict[str, Any]:
    empty: dict[str, Any] = {"g": 9.81, "body_forces": [], "point_loads": [], "surface_loads": [], "displacements": []}
    return record("compas_dem.problem/BoundaryConditionGroup", **(empty | loads))


def written(folder: Path, content: object) -> Path:
    path = folder / "model.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


FLOOR, STONE = mesh((-1, -1, -1), (3, 2, 1)), mesh((0, 0, 0), (0.4, 0.4, 1.0))


def test_lists_of_shapes_stand_on_a_floor(tmp_path: Path) -> None:
    frame = {"point": [0.2, 0.2, 1.5], "xaxis": [0.0, 1.0, 0.0], "yaxis": [-1.0, 0.0, 0.0]}
    box = record("compas.geometry/Box", xsize=0.2, ysize=0.4, zsize=1.0, frame=frame)
    top = record(
        "compas.geometry/Polyhedron",
        vertices=[[0, 0, 2], [0.4, 0, 2], [0, 0.4, 2], [0.1, 0.1, 2.5]],
        faces=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    )
    problem = read_model(written(tmp_path, {"blocks": [STONE, box], "more": top}), density=1800.0)
    assert [block.name for block in problem.blocks] == ["0", "1", "2", "floor"]
    volumes = [block.surface.moments()[0] for block in problem.blocks[:3]]
    assert_allclose(volumes, [0.16, 0.08, 0.5 * 0.16 * 0.5 / 3], rtol=1e-12)
    assert_allclose(np.ptp(problem.blocks[1].surface.points, axis=0), [0.4, 0.2, 1.0], rtol=1e-12)  # its x axis is the world's y
    assert problem.blocks[0].density == 1800.0 and problem.mu == 0.6
    assert problem.blocks[-1].surface.points[:, 2].max() == 0.0


def test_assembly(tmp_path: Path) -> None:
    node = {
        "4": {"block": mesh((0, 0, 0), (1, 1, 1), "compas_assembly.datastructures/Block", "compas.datastructures/Mesh"), "is_support": True}
    }
    node["9"] = {"block": mesh((0, 0, 1), (1, 1, 1), "compas_assembly.datastructures/Block", "compas.datastructures/Mesh")}
    graph = record("compas.datastructures/Graph", node=node, default_node_attributes={"is_support": False})
    problem = read_model(written(tmp_path, record("compas_assembly.datastructures/Assembly", graph=graph)))
    assert [(block.name, block.support) for block in problem.blocks] == [("4", True), ("9", False)]


def test_elements_stand_where_their_groups_and_transformations_place_them(tmp_path: Path) -> None:
    content = model((STONE, False), (FLOOR, True), transformation=matrix(0.3, (1, 0, 0)), inside=matrix(0.2, (0, 0, 10)))
    problem = read_model(written(tmp_path, content))
    assert [(block.name, block.support, block.density) for block in problem.blocks] == [("1", False, 2200), ("2", True, 2200)]
    x, y = 0.2 * math.cos(0.3) - 0.2 * math.sin(0.3) + 1, 0.2 * math.sin(0.3) + 0.2 * math.cos(0.3)
    expected = x * math.cos(0.2) - y * math.sin(0.2), x * math.sin(0.2) + y * math.cos(0.2), 10.5
    assert_allclose(problem.blocks[0].surface.moments()[1], expected, atol=1e-12)


def test_the_loads_of_an_analysis(tmp_path: Path) -> None:
    """A stone of 0.4 x 0.4 x 1 m about its toe: a body force a topples it at a = 0.4 g, a force F on its side at the height z at
    F z = 0.2 m g, a moment M at M = 0.2 m g; the instantaneous load holds on while the others grow."""
    weight = 0.16 * 2200 * 9.81
    body = record("BodyForce", acceleration=[0.1 * 9.81, 0, 0], loading_type="ramp")
    side = record(
        "SurfaceLoad", block_index=1, face_index=25, load=[weight / 0.4 * 0.1, 0, 0], loading_type="ramp"
    )  # 0.4 x 1 m^2 at z = 0.5
    point = record("PointLoad", block_index=1, force=[0.1 * weight, 0, 0], moment=None, point=[0, 0.2, 0.8], loading_type="ramp")
    moment = record("PointLoad", block_index=1, force=[0, 0, 0], moment=[0, 0.05 * weight, 0], point=None, loading_type="ramp")
    steady = record("PointLoad", block_index=1, force=[0, 0, -weight], moment=None, point=None, loading_type="instantaneous")
    content = model((STONE, False), (FLOOR, True))
    for load, expected in (
        ({"body_forces": [body]}, 4.0),
        ({"surface_loads": [side]}, 4.0),
        ({"point_loads": [point]}, 0.2 / 0.08),
        ({"point_loads": [moment]}, 4.0),
        ({"point_loads": [moment, steady]}, 8.0),
    ):
        problem = read_model(written(tmp_path, posed(content, group(**load))))
        assert problem.mu == pytest.approx(0.7) and problem.title == "push"
        assert analyse(problem).coulomb.multiplier == pytest.approx(expected, rel=1e-6)


def test_bent_faces_are_cut_alike_on_both_sides() -> None:
    """Two blocks share a warped face, given from opposite corners and sides: the same diagonal cuts it."""
    corners = np.array([[0, 0, 0.0], [1, 0, 0.1], [1, 1, 0.0], [0, 1, 0.1]])
    for first in range(4):
        turned = np.roll(corners, first, axis=0)
        for points in (turned, turned[::-1]):
            cut = plane_faces(points, [[0, 1, 2, 3]])
            assert len(cut) == 2
            shared = set(cut[0]) & set(cut[1])
            assert {tuple(points[k]) for k in shared} == {(0, 0, 0), (1, 1, 0)}
    assert plane_faces(corners * [1, 1, 0], [[0, 1, 2, 3]]) == [[0, 1, 2, 3]]


def test_face_area() -> None:
    """An L of 3 m^2: its centroid by its two rectangles."""
    area, centre = face_area(np.array([[0, 0, 1.0], [2, 0, 1], [2, 1, 1], [1, 1, 1], [1, 2, 1], [0, 2, 1]]))
    assert area == pytest.approx(3) and centre == pytest.approx([(2 * 1 + 1 * 0.5) / 3, (2 * 0.5 + 1 * 1.5) / 3, 1])


WRONG: dict[str, tuple[object, str]] = {
    "an open mesh": (
        [record("Mesh", vertex=STONE["data"]["vertex"], face={"0": [2, 5, 8]})],
        "closed",
    ),
    "no vertices": ([record("compas.datastructures/Mesh", face={})], "Mesh"),
    "a face of vertices that are not there": ([record("Mesh", vertex={"0": {"x": 1}}, face={"0": [7, 8, 9]})], "no '7'"),
    "millimetres": ([mesh((0, 0, 0), (400, 400, 1000))], "1e-3"),
    "nothing to build of": ([record("compas.geometry/Point", x=0)], "expected blocks"),
    "an analysis without a model": (record("compas_dem.models/Analysis", model=None, problems=[]), "with a model"),
    "cohesion": (posed(model((STONE, False), (FLOOR, True)), c=1e5), "without cohesion"),
    "settlements": (posed(model((STONE, False), (FLOOR, True)), group(displacements=[record("Translation")])), "prescribed"),
    "a load on a block that is not there": (
        posed(model((STONE, False)), group(point_loads=[record("PointLoad", block_index=7, force=[1, 0, 0])])),
        "'7'",
    ),
    "two gravities": (posed(model((STONE, False)), group(), record("BoundaryConditionGroup", g=1.62)), "one gravity"),
    "no schema": ({"blocks": []}, "schema"),
}


@pytest.mark.parametrize("what", WRONG)
def test_refused(what: str, tmp_path: Path) -> None:
    content, said = WRONG[what]
    with pytest.raises(InputError, match=said):
        read_model(written(tmp_path, content))


def test_scale(tmp_path: Path) -> None:
    problem = read_model(written(tmp_path, [mesh((0, 0, 0), (400, 400, 1000))]), scale=1e-3)
    assert problem.blocks[0].surface.moments()[0] == pytest.approx(0.16)


def test_info_describes_models(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, posed(model((STONE, False), (FLOOR, True), (mesh((5, 0, 3), (1, 1, 1)), False)), group()))
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    for words in ("2 free, 1 held (2)", "mass         2552 kg", "mu 0.7", "1 in 4 contacts; nothing touches 3"):
        assert words in said
    assert main(["info", str(path), "--scale", "0"]) == 2


def test_info_draws_models(tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    from matplotlib.image import imread

    path = written(tmp_path, model((STONE, False), (FLOOR, True)))
    assert main(["info", str(path), "--draw", str(tmp_path / "stone.png")]) == 0
    image = imread(tmp_path / "stone.png")
    assert image.shape[:2] == (1050, 1400) and len(np.unique(np.round(255 * image[..., :3]) @ [1, 256, 65536])) > 20
