"""compas_dem's problems: equilibrium block by block, closed forms of single blocks, what its readers find, what is refused."""

from __future__ import annotations

import math
import subprocess
import sys
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.errors import InputError, NotConverged

compas = pytest.importorskip("compas")
pytest.importorskip("compas_dem")

from compas.datastructures import Mesh  # noqa: E402
from compas.geometry import Box, Frame, Rotation, Translation  # noqa: E402
from compas_dem.elements import Block  # noqa: E402
from compas_dem.material import Stone  # noqa: E402
from compas_dem.models import Analysis, BlockModel  # noqa: E402
from compas_dem.problem import Problem  # noqa: E402
from compas_dem.templates import ArchTemplate  # noqa: E402

from fcsim.compas import from_analysis, solve  # noqa: E402

G, RHO = 9.81, 2200.0


def build(*boxes: Any, supports: tuple[int, ...] = (0,), density: float = RHO, turn: Any = None) -> Any:
    """A model of boxes (or meshes), of one stone, turned as a whole."""
    model = BlockModel()
    for k, shape in enumerate(boxes):
        block = Block.from_mesh(shape) if isinstance(shape, Mesh) else Block.from_box(shape)
        if turn is not None:
            block.transformation = turn
        block.is_support = k in supports
        model.add_element(block)
    stone = Stone(density=density, Ecm=20000, poisson=0.2, fck=None, ft=None)
    model.add_material(stone)
    model.assign_material(stone, elements=list(model.elements()))
    return model


def posed(model: Any, mu: float = 0.7) -> Any:
    problem = Problem(model)
    problem.set_contact_model("MohrCoulomb", mu=mu)
    return problem


def box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> Any:
    return Box(*size, frame=Frame(centre, [1, 0, 0], [0, 1, 0]))


def moments(mesh: Any) -> tuple[float, np.ndarray]:
    """Volume and centroid by the tetrahedra between the faces' triangles and a corner."""
    total, arm = 0.0, np.zeros(3)
    origin = np.array(mesh.vertex_coordinates(next(iter(mesh.vertices()))))
    for face in mesh.faces():
        corners = [np.array(mesh.vertex_coordinates(v)) - origin for v in mesh.face_vertices(face)]
        for b, c in pairwise(corners[1:]):
            six = float(np.linalg.det([corners[0], b, c]))
            total, arm = total + six, arm + six * (corners[0] + b + c) / 4
    return abs(total) / 6, origin + arm / total


def imbalance(model: Any, results: Any, loads: dict[int, tuple[np.ndarray, np.ndarray]] | None = None, density: float = RHO) -> float:
    """The largest force or moment left on a free block over the weight of all; loads: (force, moment about 0) by node."""
    weight, left = 0.0, []
    for block in model.elements():
        if block.is_support:
            continue
        volume, centre = moments(block.modelgeometry)
        force = np.array([0, 0, -density * volume * G])
        weight += density * volume * G
        moment = np.cross(centre, force)
        if loads and block.graphnode in loads:
            force, moment = force + loads[block.graphnode][0], moment + loads[block.graphnode][1]
        for edge in results.edges():
            if block.graphnode in edge:
                sign = 1.0 if edge[0] == block.graphnode else -1.0
                for point, one in zip(results.contact_point(edge), results.force_vector(edge), strict=True):
                    force, moment = force + sign * np.array(one), moment + sign * np.cross(point, one)
        left += [np.abs(force).max(), np.abs(moment - np.cross(centre, force)).max()]
    return max(left) / weight


@pytest.fixture(scope="module")
def arch() -> tuple[Any, Any, Any]:
    model = BlockModel.from_template(ArchTemplate(rise=3, span=10, thickness=0.5, depth=0.5, n=20))
    model.compute_contacts(tolerance=1e-3)
    for node in model.graph.nodes_where(degree=1):
        model.add_support(node)
    stone = Stone.from_predefined_material("Limestone")
    model.add_material(stone)
    model.assign_material(stone, elements=list(model.elements()))
    problem = posed(model)
    return model, problem, solve(problem)


def test_every_block_of_an_arch_is_in_equilibrium(arch: tuple[Any, Any, Any]) -> None:
    """And its thrust is one that the arch admits: the range was found by limit analysis of another program, 21.14 to 34.45 kN."""
    model, problem, results = arch
    assert results.model_id == str(model.guid) and results.problem_id == str(problem.guid)
    assert imbalance(model, results) < 1e-6
    assert results.metadata["converged"] and results.metadata["error"] < 1e-9 and "added_edges" not in results.metadata
    thrust = abs(results.resultant_global((9, 10))[0])
    assert 21.14e3 < thrust < 34.45e3
    reactions = [
        np.array(results.resultant_global(edge)) * (-1 if edge[0] in (0, 19) else 1) for edge in results.edges() if {0, 19} & set(edge)
    ]
    weight = sum(RHO * moments(b.modelgeometry)[0] * G for b in model.elements() if not b.is_support)
    assert_allclose(np.sum(reactions, axis=0), [0, 0, weight], atol=1e-8 * weight)
    matrices = [results.transformation(node).matrix for node in results.nodes()]
    assert_allclose(matrices, np.tile(np.eye(4), (20, 1, 1)), atol=1e-6)


def test_what_readers_find_of_a_joint(arch: tuple[Any, Any, Any]) -> None:
    """The rules of compas_dem's readers: forces on edge[0], z into it, the polygon around z, parts that sum to the whole, through JSON."""
    model, _, results = arch
    again = compas.json_loads(compas.json_dumps(results))
    assert len(list(again.edges())) == 19
    for edge in again.edges():
        assert model.graph.has_edge(edge) and again.face_contact(edge)
        frame, contact, total = again.contact_frame(edge), again.contact_data(edge), np.array(again.resultant_global(edge))
        into = np.array(model.graph.node_element(edge[0]).point) - np.array(frame.point)
        assert np.dot(into, frame.zaxis) > 0 and np.dot(again.contact_polygon(edge).normal, frame.zaxis) > 0.999
        assert_allclose(np.sum(again.force_vector(edge), axis=0), total, rtol=1e-12)
        axes = np.array([frame.xaxis, frame.yaxis, frame.zaxis])
        assert_allclose(np.array(again.resultant_local(edge)) @ axes, total, rtol=1e-9)
        assert_allclose(contact.resultantpoint, again.edge_attribute(edge, "force_point"), atol=1e-9)
        assert again.force_magnitude(edge) == pytest.approx(np.linalg.norm(total))
        assert min(again.force_normal(edge)) >= 0 and max(map(abs, again.gap(edge))) < 1e-7
        assert all(f["c_nn"] == 0 for f in contact.forces)


def dome(around: int, up: int) -> list[Any]:
    """Bricks of a spherical dome of radius 5 m and 0.3 m thick, rings of `around` / 2 bricks from the oculus down, each turned by half a
    brick against the next: a brick is two cells with plane faces, so that joints fit."""
    meshes = []
    for ring in range(up):
        for first in range(ring % 2, around + ring % 2, 2):
            points = []
            for k, row, r in product((first, first + 1, first + 2), (ring, ring + 1), (5.0, 5.3)):
                down, turn = math.pi * (0.1 + 0.4 * row / up), 2 * math.pi * (k % around) / around
                points.append([r * math.sin(down) * math.cos(turn), r * math.sin(down) * math.sin(turn), r * math.cos(down)])
            cell = [(0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6)]  # within, without, above, below
            faces = [tuple(c + shift for c in face) for shift in (0, 4) for face in cell]
            meshes.append(Mesh.from_vertices_and_faces(points, [*faces, (0, 1, 3, 2), (8, 10, 11, 9)]))
    return meshes


@pytest.mark.parametrize(("around", "up"), [(16, 6), pytest.param(32, 12, marks=pytest.mark.slow)])
def test_every_brick_of_a_dome_is_in_equilibrium(around: int, up: int) -> None:
    """The dome of compas_dem's example (32 by 12: 192 bricks), its lowest ring held: reactions sum to the weight."""
    bricks = dome(around, up)
    held = tuple(range(len(bricks) - around // 2, len(bricks)))
    model = build(*bricks, supports=held)
    model.compute_contacts(tolerance=1e-3)
    results = solve(posed(model))
    assert imbalance(model, results) < 1e-6 and results.metadata["converged"]
    weight = sum(RHO * moments(b.modelgeometry)[0] * G for b in model.elements() if not b.is_support)
    on_supports = [edge for edge in results.edges() if len({edge[0] in held, edge[1] in held}) == 2]
    reactions = [np.array(results.resultant_global(edge)) * (-1 if edge[0] in held else 1) for edge in on_supports]
    assert_allclose(np.sum(reactions, axis=0), [0, 0, weight], atol=1e-8 * weight)
    # the membrane pushes outwards at its foot, by friction at most
    out = [np.array(results.force_point(edge))[:2] @ force[:2] for edge, force in zip(on_supports, reactions, strict=True)]
    assert max(out) < 0  # the supports push back, inwards


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_block_on_a_slope(order: tuple[int, int]) -> None:
    """N = m g cos a, T = m g sin a up the slope, whichever block the graph's edge begins with."""
    a = 0.4
    shapes = [box((4, 4, 1), (0, 0, -0.5)), box((1, 1, 1), (0, 0, 0.5))]
    turn = Rotation.from_axis_and_angle([0, 1, 0], a)
    model = build(*(shapes[k] for k in order), supports=(order.index(0),), turn=turn)
    model.graph.add_edge(0, 1)
    results = solve(posed(model, mu=math.tan(a) * 1.01))
    sign = 1.0 if order[0] == 1 else -1.0  # the force on edge[0]
    assert_allclose(sign * np.array(results.resultant_global((0, 1))), [0, 0, RHO * G], atol=1e-6 * RHO * G)
    local = results.resultant_local((0, 1))
    assert local[2] == pytest.approx(RHO * G * math.cos(a)) and math.hypot(*local[:2]) == pytest.approx(RHO * G * math.sin(a))
    assert imbalance(model, results) < 1e-6


def test_it_slides_where_friction_is_less() -> None:
    """Statics refuse; dynamics: s = (sin a - mu cos a) g t^2 / 2 to first order of the step, the block's own mu in place of the model's."""
    a, mu, n, h = 0.4, 0.2, 100, 1e-3
    turn = Rotation.from_axis_and_angle([0, 1, 0], a)
    model = build(box((4, 4, 1), (0, 0, -0.5)), box((1, 1, 1), (0, 0, 0.5)), turn=turn)
    with pytest.raises(NotConverged, match=r"expected a structure that stands.*block 1"):
        solve(posed(model, mu=mu))
    results = solve(posed(model), mu_between={(0, 1): mu}, n_steps=n, dt=h, theta=0.5)
    s = (math.sin(a) - mu * math.cos(a)) * G * (n * h) ** 2 / 2
    assert_allclose(results.displacement(1), s * np.array([math.cos(a), 0, -math.sin(a)]), rtol=1e-2, atol=1e-4 * s)
    assert set(results.status((0, 1))) == {"slip"} and results.metadata["speed"] == pytest.approx(2 * s / (n * h), rel=1e-2)


def test_loads_of_every_kind() -> None:
    """On a cube on a base, of another density: the joint bears their sum at the place that moments say."""
    model = build(box((3, 3, 1), (0, 0, -0.5)), box((1, 1, 1), (0, 0, 0.5)), density=3000.0)
    problem = posed(model)
    group = problem.add_boundary_condition("all")
    W = 3000.0 * G
    group.add_point_load(1, [0.0, 0.1 * W, 0.0], point=[0.5, 0.0, 1.0], loading_type="instantaneous")
    group.add_moment(1, [0.0, 0.05 * W, 0.0])
    group.add_global_body_force(0.05 * G, 0.0, 0.0)
    top = next(
        f for f in model.graph.node_element(1).modelgeometry.faces() if model.graph.node_element(1).modelgeometry.face_centroid(f)[2] > 0.99
    )
    group.add_surface_load(1, top, [0.0, 0.0, -0.5 * W])
    results = solve(problem)
    edge = next(iter(results.edges()))
    force = np.array(results.resultant_global(edge)) * (1 if edge[0] == 1 else -1)
    assert_allclose(force, np.array([-0.05, -0.1, 1.5]) * W, atol=1e-6 * W)
    # about x: the force 0.1 W along y at z = 1; about y: 0.05 W at z = 0.5, and the moment
    assert_allclose(results.edge_attribute(edge, "force_point"), [(0.05 * 0.5 + 0.05) / 1.5, 0.1 / 1.5, 0.0], atol=1e-6)
    assert results.metadata["mu"] == pytest.approx(0.7) and results.metadata["statics"]


def test_settlements_and_rotations() -> None:
    """Two columns on two supports, one of which sinks and turns: the column on it goes along."""
    shapes = [box((1, 1, 1), (x, 0, -0.5)) for x in (0, 3)] + [box((0.8, 0.8, 1), (x, 0, 0.5)) for x in (0, 3)]
    model = build(*shapes, supports=(0, 1))
    problem = posed(model)
    group = problem.add_boundary_condition("settlement")
    group.add_displacement(1, dx=0.02, dz=-0.1)
    group.add_rotation(1, [0.0, 0.1, 0.0])
    results = solve(problem, n_steps=20)
    assert_allclose(results.transformation(0).matrix, np.eye(4), atol=1e-9)
    turn = Rotation.from_axis_and_angle([0, 1, 0], 0.1, point=[3, 0, -0.5])
    expected = np.array((Translation.from_vector([0.02, 0, -0.1]) * turn).matrix)
    assert_allclose(results.transformation(1).matrix, expected, atol=1e-6)
    assert_allclose(results.transformation(3).matrix, expected, atol=1e-3)  # of the steps in which it turns
    assert_allclose(results.resultant_local((1, 3))[2], RHO * 0.64 * G * math.cos(0.1), rtol=1e-6)


def test_deformable_blocks() -> None:
    """A column under its weight: the joint bears it, and its mean sinks by about rho g h^2 / (3 E) of a bar, less what its foot holds."""
    model = build(box((1, 1, 0.2), (0, 0, -0.1)), box((0.5, 0.5, 2), (0, 0, 1)))
    results = solve(posed(model), blocks="deformable", E=1e7, nu=0.0)
    assert_allclose(np.abs(results.resultant_global((0, 1))), [0, 0, RHO * 0.5 * G], atol=1e-4 * RHO * G)
    sunk = RHO * G * 4 / (3 * 1e7)
    assert -1.3 * sunk < results.displacement(1)[2] < -0.5 * sunk


def test_from_analysis(tmp_path: Path) -> None:
    model = build(box((3, 3, 1), (0, 0, -0.5)), box((1, 1, 1), (0, 0, 0.5)))
    analysis = Analysis(model)
    for name in ("one", "other"):
        problem = Problem(model, name=name)
        problem.set_contact_model("MohrCoulomb", phi=30)
        analysis.add_problem(problem)
    compas.json_dump(analysis, tmp_path / "a.json")
    results = solve(from_analysis(tmp_path / "a.json", "other"))
    assert results.metadata["mu"] == pytest.approx(math.tan(math.radians(30)))
    for name, said in ((None, "'one', 'other'"), ("third", "'third'")):
        with pytest.raises(InputError, match=said):
            from_analysis(tmp_path / "a.json", name)
    with pytest.raises(InputError, match="no such file"):
        from_analysis(tmp_path / "b.json")


def test_the_script_of_the_page_runs(tmp_path: Path) -> None:
    page = Path(__file__).parents[3] / "docs" / "compas.md"
    script = page.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env={"PYTHONPATH": str(page.parents[1])}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_refused() -> None:
    shapes = box((3, 3, 1), (0, 0, -0.5)), box((1, 1, 1), (0, 0, 0.5))
    problem = posed(build(*shapes))
    for settings, said in (
        ({"duration": 1.0}, "expected two of them"),
        ({"duration": 1.0, "n_steps": 5, "dt": 0.2}, "expected two of them"),
        ({"n_steps": -1}, "> 0"),
        ({"n_steps": 2.5}, "whole number"),
        ({"mu": -0.1}, ">= 0"),
        ({"mu_between": {(0, 7): 0.3}}, "'7'"),
        ({"blocks": "soft"}, "deformable"),
    ):
        with pytest.raises(InputError, match=said):
            solve(problem, **settings)
    bare = BlockModel.from_boxes(list(shapes))
    bare.add_support(0)
    with pytest.raises(InputError, match="block 1: expected a material"):
        solve(posed(bare))
    assert solve(posed(bare), density=1000.0).force_magnitude((0, 1)) == pytest.approx(1000 * G)
    with pytest.raises(InputError, match="modulus"):
        solve(posed(bare), density=1000.0, blocks="deformable")
    with pytest.raises(InputError, match="contact model"):
        solve(Problem(build(*shapes)))
    cohesive = Problem(build(*shapes))
    cohesive.set_contact_model("MohrCoulomb", mu=0.5, c=1e5)
    with pytest.raises(InputError, match="without cohesion"):
        solve(cohesive)
    deep = build(box((3, 3, 1), (0, 0, -0.5)), box((1, 1, 1), (0, 0, 0.4)))
    with pytest.raises(InputError, match="overlap"):
        solve(posed(deep))
    assert solve(posed(deep), witness=None).metadata["converged"]
    with pytest.raises(InputError, match="with supports"):
        solve(posed(build(*shapes, supports=())))
    with pytest.raises(NotConverged, match="block 1"):  # it hangs in the air
        solve(posed(build(box((3, 3, 1), (0, 0, -0.5)), box((1, 1, 1), (0, 0, 5.5)))))
    lost = posed(build(*shapes))
    lost.add_boundary_condition("x").add_displacement(5, dz=0.1)
    with pytest.raises(InputError, match="block 5"):
        solve(lost)
