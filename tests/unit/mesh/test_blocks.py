"""Blocks: counts, volumes, named surfaces and inertia, and parts from a user's own gmsh model."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, part_from_gmsh, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.quality import cell_volumes
from fcsim.runtime import gmsh_model

MATERIAL = Material(E=1e9, nu=0.2, density=2000)
SIZE, DIVISIONS, ORIGIN = (2.0, 1.0, 0.5), (4, 3, 2), (1.0, -2.0, 3.0)


def normals(points, facets):
    """Area vectors (nf, d), outward by the convention of Part: cross product of the diagonals, or (t_y, -t_x) in 2D."""
    x = points[facets]
    if points.shape[1] == 2:
        t = x[:, 1] - x[:, 0]
        return np.stack((t[:, 1], -t[:, 0]), axis=1)
    return np.cross(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1]) / 2


def check_box(points, surfaces, size, origin):
    """Every face lies where its name says, looks outwards and has its area; together they close the box (divergence theorem)."""
    d = len(size)
    assert list(surfaces) == [a + s for a in "xyz"[:d] for s in "-+"]
    for name, facets in surfaces.items():
        axis, sign = "xyz".index(name[0]), 1 if name[1] == "+" else -1
        assert points[facets][..., axis] == pytest.approx(origin[axis] + (sign > 0) * size[axis])
        expected = np.zeros(d)
        expected[axis] = sign * np.prod(size) / size[axis]
        assert normals(points, facets).sum(axis=0) == pytest.approx(expected, abs=1e-12)
        assert np.linalg.norm(normals(points, facets), axis=1).sum() == pytest.approx(abs(expected[axis]))
    closed = np.concatenate(list(surfaces.values()))
    n = normals(points, closed)
    assert n.sum(axis=0) == pytest.approx(0, abs=1e-12)
    assert np.sum(points[closed].mean(axis=1) * n) / d == pytest.approx(np.prod(size))


@pytest.mark.parametrize(("cell", "per_box"), [("hexahedron", 1), ("tetrahedron", 6)])
def test_brick(cell, per_box):
    part = brick("b", SIZE, DIVISIONS, MATERIAL, cell, ORIGIN)
    assert len(part.points) == 5 * 4 * 3
    assert len(part.cells) == per_box * 4 * 3 * 2
    assert cell_volumes(part.points, part.cells, cell).min() > 0
    assert cell_volumes(part.points, part.cells, cell).sum() == pytest.approx(1.0)
    assert {name: len(f) for name, f in part.surfaces.items()} == {
        name: count * (1 if cell == "hexahedron" else 2) for name, count in {"x-": 6, "x+": 6, "y-": 8, "y+": 8, "z-": 12, "z+": 12}.items()
    }
    check_box(part.points, part.surfaces, SIZE, ORIGIN)


@pytest.mark.parametrize(("cell", "per_box"), [("quadrilateral", 1), ("triangle", 2)])
def test_rectangle(cell, per_box):
    part = rectangle("r", SIZE[:2], DIVISIONS[:2], MATERIAL, cell, plane="stress", thickness=0.1, origin=ORIGIN[:2])
    assert (part.plane, part.thickness, part.points.shape) == ("stress", 0.1, (20, 2))
    assert len(part.cells) == per_box * 12
    assert cell_volumes(part.points, part.cells, cell).sum() == pytest.approx(2.0)
    check_box(part.points, part.surfaces, SIZE[:2], ORIGIN[:2])


def test_the_structured_nodes_are_a_regular_grid():
    part = brick("b", (0.2, 0.1, 0.1), (8, 4, 4), MATERIAL)
    grid = np.stack(np.meshgrid(np.linspace(0, 0.2, 9), np.linspace(0, 0.1, 5), np.linspace(0, 0.1, 5), indexing="ij"), -1).reshape(-1, 3)
    order = np.lexsort(np.round(part.points.T[::-1], 9))
    assert part.points[order] == pytest.approx(grid, abs=1e-15)


@pytest.mark.parametrize(("divisions", "points", "facets"), [(None, 8, 6), ((2, 3, 4), 60 - 1 * 2 * 3, 2 * (6 + 8 + 12))])
def test_rigid_box(divisions, points, facets):
    body = rigid_box("platen", (2, 3, 4), (1, 1, 1), 12, divisions)
    assert body.points.shape == (points, 3)
    assert sum(map(len, body.surfaces.values())) == facets
    assert body.inertia == pytest.approx(np.diag([25, 20, 13]))  # m/12 (ly^2 + lz^2), ...
    check_box(body.points, body.surfaces, (2, 3, 4), (0, -0.5, -1))


def test_the_inertia_of_the_box_is_that_of_its_elements():
    """Second moments of a fine mesh of the same box, element by element."""
    part = brick("b", (2, 3, 4), (12, 12, 12), Material(1, 0, 1), origin=(-1, -1.5, -2))
    c = part.points[part.cells].mean(axis=1)
    m = 12 * cell_volumes(part.points, part.cells, "hexahedron") / 24
    second = np.einsum("e,ei,ej->ij", m, c, c)
    inertia = np.trace(second) * np.eye(3) - second
    assert rigid_box("r", (2, 3, 4), (0, 0, 0), 12).inertia == pytest.approx(inertia, rel=0.01, abs=1e-12)


@pytest.mark.parametrize(("divisions", "points"), [(None, 4), ((2, 3), 10)])
def test_rigid_rectangle(divisions, points):
    body = rigid_rectangle("r", (3, 4), (1, 2), 6, divisions)
    assert body.points.shape == (points, 2)
    assert body.inertia == pytest.approx(np.array([[6 / 12 * 25]]))
    check_box(body.points, body.surfaces, (3, 4), (-0.5, 0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"size": (1, 1)}, "'b', size: expected 3 finite numbers"),
        ({"size": (1, 0, 1)}, "size: expected lengths > 0"),
        ({"size": (1, float("nan"), 1)}, "size: expected 3 finite numbers"),
        ({"divisions": (1, 0, 1)}, "divisions: expected whole numbers >= 1"),
        ({"divisions": (1, 1.5, 1)}, "divisions: expected whole numbers >= 1"),
        ({"divisions": "abc"}, "divisions: expected 3 finite numbers"),
        ({"origin": (1, 1)}, "origin: expected 3 finite numbers"),
        ({"cell": "triangle"}, "cell: expected 'hexahedron' or 'tetrahedron', got 'triangle'"),
        ({"cell": "hexahedron27"}, "cell: expected 'hexahedron' or 'tetrahedron'"),
    ],
)
def test_wrong_arguments_are_refused(change, message):
    arguments = {"size": (1, 1, 1), "divisions": (1, 1, 1), "material": MATERIAL} | change
    with pytest.raises(InputError, match=message):
        brick("b", **arguments)


def test_a_failure_inside_gmsh_does_not_poison_the_next_model():
    with pytest.raises(ZeroDivisionError), gmsh_model("first") as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        raise ZeroDivisionError
    with pytest.raises(Exception, match="box"), gmsh_model("second") as gmsh:  # an error of gmsh itself
        gmsh.model.occ.addBox(0, 0, 0, 0, 0, 0)
    with gmsh_model("third") as gmsh:
        assert gmsh.model.getCurrent() == "third"
        assert {"first", "second"}.isdisjoint(gmsh.model.list())
    assert len(brick("b", (1, 1, 1), (2, 2, 2), MATERIAL).cells) == 8


def test_a_user_model_of_a_cylinder():
    """Unstructured tetrahedra; the polygon inscribed in the circle has the volume that the divergence theorem gives."""
    with gmsh_model("column") as gmsh:
        solid = gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 0.5)
        gmsh.model.occ.addPoint(5, 5, 5)  # a node that no element uses
        gmsh.model.occ.synchronize()
        for _, face in gmsh.model.getBoundary([(3, solid)], oriented=False):
            z = gmsh.model.occ.getCenterOfMass(2, face)[2]
            gmsh.model.addPhysicalGroup(2, [face], name={0: "foot", 2: "head"}.get(round(z), "mantle"))
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.model.mesh.generate(3)
        part = part_from_gmsh(gmsh, "column", MATERIAL)
    assert (part.name, part.cell_type, set(part.surfaces)) == ("column", "tetrahedron", {"foot", "head", "mantle"})
    closed = np.concatenate(list(part.surfaces.values()))
    n = normals(part.points, closed[:, [0, 1, 2, 2]])
    volume = cell_volumes(part.points, part.cells, "tetrahedron").sum()
    assert n.sum(axis=0) == pytest.approx(0, abs=1e-12)
    assert np.sum(part.points[closed].mean(axis=1) * n) / 3 == pytest.approx(volume)
    assert 0.9 * np.pi / 2 < volume < np.pi / 2
    assert normals(part.points, part.surfaces["foot"][:, [0, 1, 2, 2]])[:, 2].max() < 0


def two_volumes(gmsh, interface_name="interface"):
    a, b = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1), gmsh.model.occ.addBox(1, 0, 0, 1, 1, 1)
    gmsh.model.occ.fragment([(3, a)], [(3, b)])
    gmsh.model.occ.synchronize()
    faces = {round(gmsh.model.occ.getCenterOfMass(*f)[0], 6): f[1] for f in gmsh.model.getEntities(2)}
    gmsh.model.addPhysicalGroup(2, [faces[1.0]], name=interface_name)
    gmsh.model.addPhysicalGroup(2, [faces[0.0]], name="left")
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
    return a, b


def test_one_of_two_volumes_is_chosen_by_name():
    with gmsh_model("pair") as gmsh:
        a, b = two_volumes(gmsh)
        gmsh.model.addPhysicalGroup(3, [a], name="a")
        gmsh.model.addPhysicalGroup(3, [b], name="b")
        gmsh.model.mesh.generate(3)
        left, right = (part_from_gmsh(gmsh, f"part {v}", MATERIAL, volume=v) for v in "ab")
        with pytest.raises(InputError, match="expected one volume or an argument volume=, got the volumes 'a', 'b'"):
            part_from_gmsh(gmsh, "p", MATERIAL)
        with pytest.raises(InputError, match="expected a volume among 'a', 'b', got 'c'"):
            part_from_gmsh(gmsh, "p", MATERIAL, volume="c")
    assert (set(left.surfaces), set(right.surfaces)) == ({"interface", "left"}, {"interface"})
    for part, sign in ((left, 1), (right, -1)):  # each sees the interface from its own side
        assert cell_volumes(part.points, part.cells, part.cell_type).sum() == pytest.approx(1)
        facets = part.surfaces["interface"]
        assert normals(part.points, facets[:, [0, 1, 2, 2]]).sum(axis=0) == pytest.approx([sign, 0, 0], abs=1e-12)


def test_a_surface_inside_the_volume_is_refused():
    with gmsh_model("pair") as gmsh:
        gmsh.model.addPhysicalGroup(3, two_volumes(gmsh, "cut"), name="both")
        gmsh.model.mesh.generate(3)
        with pytest.raises(InputError, match=r"gmsh model 'pair', surface 'cut': expected facets on the boundary.*that are not"):
            part_from_gmsh(gmsh, "p", MATERIAL)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda gmsh: gmsh.model.mesh.setOrder(3), "expected cells of first or full second order .* got .*Tetrahedron 20"),
        (lambda gmsh: gmsh.model.mesh.clear(), "expected volume cells .* got none"),
        (lambda gmsh: gmsh.model.mesh.affineTransform([-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]), "of them inverted"),
    ],
)
def test_models_that_cannot_be_used_are_refused(build, message):
    with gmsh_model("box") as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(3)
        build(gmsh)
        with pytest.raises(InputError, match=message):
            part_from_gmsh(gmsh, "p", MATERIAL)


def test_a_surface_mesh_in_space_is_refused():
    with gmsh_model("shell") as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(2)
        with pytest.raises(InputError, match="got a surface mesh in space"):
            part_from_gmsh(gmsh, "p", MATERIAL)


@pytest.mark.parametrize("size", [(1e-300, 1e-300, 1e-300), (1.0, 1.0, 1e-8), (1e-16, 1e-9, 1e-9), (1.0, 1.0, 1e15), (1e300, 1e300, 1e300)])
def test_lengths_that_gmsh_does_not_tell_apart_are_refused(size: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="'b', size: expected lengths above"):
        brick("b", size, (1, 1, 1), Material(1e9, 0.2, 1e3))


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("power", [-20, -33])
def test_small_boxes_are_meshed_as_large_ones(power: int, cell: str) -> None:
    """A micrometre, a tenth of a nanometre: gmsh, asked for boxes of 2e-7 m, makes a mixture of cells of them."""
    unit, material = 2.0**power, Material(1e9, 0.2, 1e3)
    size, origin = np.array([1.0, 0.2, 0.7]), np.array([0.3, -1.0, 5.0])
    small, large = (brick("b", k * size, (3, 2, 4), material, cell=cell, origin=k * origin) for k in (unit, 1.0))
    assert np.array_equal(small.points, unit * large.points)
    assert np.array_equal(small.cells, large.cells)


def test_an_origin_beside_which_a_box_is_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"origin: expected one within 1e9 lengths of the box, got \[1e\+20, 0.0, 0.0\]"):
        brick("far", (1.0, 1.0, 1.0), (1, 1, 1), Material(1e9, 0.2, 2000.0), origin=(1e20, 0.0, 0.0))


@pytest.mark.parametrize(("make", "dimension"), [(rigid_box, 3), (rigid_rectangle, 2)])
@pytest.mark.parametrize("seed", range(4))
def test_a_box_of_one_facet_a_face_is_what_gmsh_makes_of_it(make, dimension, seed):
    rng = np.random.default_rng(seed)
    size, centre = 10 ** rng.uniform(-2, 2, dimension), rng.choice([-1, 1], dimension) * 10 ** rng.uniform(-2, 2, dimension)
    ours, meshed = make("box", size, centre, 2.0), make("box", size, centre, 2.0, (1,) * dimension)
    assert np.array_equal(ours.points, meshed.points)
    assert list(ours.surfaces) == list(meshed.surfaces)
    assert all(np.array_equal(ours.surfaces[name], meshed.surfaces[name]) for name in meshed.surfaces)


@pytest.mark.parametrize(
    ("size", "centre"), [((1, 0, 1), (0, 0, 0)), ((1, 1e-9, 1), (0, 0, 0)), ((1, 1), (0, 0, 0)), ((1, 1, 1), (1e18, 0, 0))]
)
def test_a_box_without_an_inside_is_refused_by_name(size, centre):
    with pytest.raises(InputError, match=r"'flat', (size|origin): expected"):
        rigid_box("flat", size, centre, 1.0)


def test_threads_mesh_one_after_the_other() -> None:
    """A process has one gmsh: parts that threads make at a time are those that one makes."""
    expected = brick("b", (0.3, 0.2, 0.1), (3, 2, 1), MATERIAL)
    with ThreadPoolExecutor(4) as pool:
        for part in pool.map(lambda _: brick("b", (0.3, 0.2, 0.1), (3, 2, 1), MATERIAL), range(8)):
            assert np.array_equal(part.points, expected.points) and np.array_equal(part.cells, expected.cells)


def test_a_program_that_works_with_gmsh_itself() -> None:
    """Its options would change our meshes, and `finalize` of ours would take its models: refused, and its session is as it was."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.model.add("mine")
        with pytest.raises(InputError, match=r"mesh of 'b': expected gmsh to be free.* after gmsh.finalize"):
            brick("b", (0.3, 0.2, 0.1), (3, 2, 1), MATERIAL)
        assert gmsh.model.getCurrent() == "mine"
    finally:
        gmsh.finalize()
    assert len(brick("b", (0.3, 0.2, 0.1), (3, 2, 1), MATERIAL).cells) == 6
