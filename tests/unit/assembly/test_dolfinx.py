"""Parts of dolfinx meshes, their tags, forms as loads, and functions of a body's state."""

from typing import Any

import numpy as np
import pytest

import fcsim
from fcsim import runtime
from fcsim.assembly import elasticity
from fcsim.assembly.functions.of_bodies import body_function
from fcsim.errors import InputError, MissingDependency
from fcsim.mesh import Body, brick, rigid_box
from fcsim.mesh.quality import cell_volumes, check_quality

SOFT, HARD = fcsim.Material(1e6, 0.3, 1000.0), fcsim.Material(2e6, 0.2, 3000.0)
CELLS = [("triangle", 2), ("quadrilateral", 2), ("tetrahedron", 3), ("hexahedron", 3)]


@pytest.fixture(scope="module", autouse=True)
def dolfinx() -> Any:
    try:
        return runtime.dolfinx()
    except MissingDependency as error:
        pytest.skip(str(error))


def box(dolfinx: Any, cell: str, d: int, mirrored: bool = False) -> Any:
    """A box of 2 x 1 (x 1) m; mirrored: in x, so that dolfinx's cells are left-handed."""
    from mpi4py import MPI

    kind = dolfinx.mesh.CellType[cell]
    if d == 2:
        mesh = dolfinx.mesh.create_rectangle(MPI.COMM_SELF, [(0, 0), (2, 1)], (4, 2), kind)
    else:
        mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, [(0, 0, 0), (2, 1, 1)], (4, 2, 2), kind)
    if mirrored:
        mesh.geometry.x[:, 0] = 2 - mesh.geometry.x[:, 0]
    return mesh


def tags_of(dolfinx: Any, mesh: Any, dim: int, where: list[Any]) -> Any:
    found = [
        (dolfinx.mesh.locate_entities if dim == mesh.topology.dim else dolfinx.mesh.locate_entities_boundary)(mesh, dim, w) for w in where
    ]
    numbers = np.repeat(np.arange(1, len(found) + 1, dtype=np.int32), [len(f) for f in found])
    order = np.argsort(np.concatenate(found))
    return dolfinx.mesh.meshtags(mesh, dim, np.concatenate(found)[order], numbers[order])


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("cell", "d"), CELLS)
def test_a_mesh_with_tags_becomes_a_part(dolfinx: Any, cell: str, d: int, mirrored: bool) -> None:
    """Regions and surfaces by their tags, outwards; the mass of both materials; nodes as the mesh's."""
    mesh = box(dolfinx, cell, d, mirrored)
    cells = tags_of(dolfinx, mesh, d, [lambda x: x[0] <= 1 + 1e-9, lambda x: x[0] >= 1 - 1e-9])
    facets = tags_of(dolfinx, mesh, d - 1, [lambda x: np.isclose(x[0], 0), lambda x: np.isclose(x[0], 2)])
    part = fcsim.part_from_dolfinx(
        "part", mesh, {1: SOFT, 2: HARD}, cell_tags=cells, facet_tags=facets, surfaces={"left": 1, "both": (1, 2)}
    )
    assert part.cell_type == cell
    assert np.array_equal(part.points, mesh.geometry.x[:, :d])
    check_quality(part)
    assert cell_volumes(part.points, part.cells, cell).sum() == pytest.approx(2)
    assert elasticity.lumped_mass(part).sum() / d == pytest.approx(1000 + 3000)
    assert elasticity.traction(part, "both", [1.0, *(0.0,) * (d - 1)]).sum() == pytest.approx(2)
    pressed = elasticity.pressure(part, "left", 1.0).reshape(-1, d)
    assert pressed.sum(axis=0) == pytest.approx([1, *(0,) * (d - 1)], abs=1e-12)  # into the part
    assert set(part.regions) == {"1", "2"}


@pytest.mark.each_value
@pytest.mark.parametrize("field", ["displacement", "velocity"])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("elements", [None, "second"])
@pytest.mark.parametrize(("cell", "d"), CELLS)
def test_functions_are_those_of_the_nodes(dolfinx: Any, cell: str, d: int, elements: Any, mirrored: bool, field: Any) -> None:
    """A linear (second order: quadratic) field of the nodes is the interpolated one, on the user's mesh where the part is that mesh's."""
    mesh = box(dolfinx, cell, d, mirrored)
    name = None if elements is None else {"triangle": "P2", "tetrahedron": "P2"}.get(cell, "Q2")
    part = fcsim.part_from_dolfinx("part", mesh, SOFT, elements=name)
    model = fcsim.build_model([Body("body", part), Body("other", part, translation=(5.0,) * d)])
    power = 1 if elements is None else 2

    def wanted(x: Any) -> Any:
        return np.stack([1e-3 * (x[0] ** power + 2 * x[1]), *(1e-3 * x[k] * (x[0] if power == 2 else 1) for k in range(1, d))])

    values = np.zeros(model.n_dofs)
    values[: part.points.size] = wanted(part.points.T).T.ravel()
    function = body_function(model, "body", values, values, field)
    space = function.function_space
    exact = dolfinx.fem.Function(space)
    exact.interpolate(lambda x: wanted(x[:d]))
    assert np.allclose(function.x.array, exact.x.array, atol=1e-14)
    assert (space.mesh is mesh) == (elements is None)
    assert np.abs(body_function(model, "other", values, values, field).x.array).max() == 0


@pytest.mark.parametrize("own", [True, False])
def test_stress_is_that_of_each_cell(dolfinx: Any, own: bool) -> None:
    """Uniaxial strain that grows from cell to cell: sigma_xx = (lambda + 2 mu) eps of the cell at its place, also of a turned body."""
    part = fcsim.part_from_dolfinx("part", box(dolfinx, "hexahedron", 3), SOFT) if own else brick("part", (2.0, 1.0, 1.0), (4, 2, 2), SOFT)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    model = fcsim.build_model([Body("body", part, rotation=turn)], kinematics="linear")
    u = np.zeros_like(part.points)
    u[:, 0] = 1e-3 * np.where(part.points[:, 0] > 1, part.points[:, 0] - 1, 0)
    x = (u @ turn.T).ravel()
    stress, mises = (body_function(model, "body", x, x, field) for field in ("stress", "von_mises"))
    mesh = stress.function_space.mesh
    centres = dolfinx.mesh.compute_midpoints(mesh, 3, np.arange(16, dtype=np.int32))
    lam, mu = 1e6 * 0.3 / (1.3 * 0.4), 1e6 / 2.6
    places = stress.function_space.dofmap.list[:, 0]
    values = stress.x.array.reshape(-1, 3, 3)[places]
    strained = centres[:, 0] > 1
    assert values[strained] == pytest.approx(np.tile(1e-3 * np.diag([lam, lam + 2 * mu, lam]), (8, 1, 1)), abs=1e-6)
    assert np.abs(values[~strained]).max() < 1e-9
    assert mises.x.array[mises.function_space.dofmap.list[:, 0]][strained] == pytest.approx(np.full(8, 2 * mu * 1e-3))


def test_forms_and_vectors_are_loads(dolfinx: Any) -> None:
    """A uniform traction and a hydrostatic body force as forms are what Traction and BodyForce make; a vector is what it is."""
    import ufl

    part = brick("part", (1.0, 1.0, 2.0), (2, 2, 3), SOFT)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    body = Body("body", part, rotation=turn)
    forms = [
        lambda p: ufl.inner(ufl.as_vector((0.0, 3.0, 0.0)), p.v) * p.ds("z+"),
        lambda p: ufl.inner(ufl.as_vector((0.0, 0.0, p.x[2])), p.v) * p.dx,
    ]
    loads = [[fcsim.FormLoad("body", form)] for form in forms]
    plain = [fcsim.build_model([body], loads=own).load(0.0).reshape(-1, 3) for own in loads]
    from fcsim.assembly.loads import Traction

    same = fcsim.build_model([body], loads=[Traction("body", "z+", (-3.0, 0.0, 0.0))]).load(0.0).reshape(-1, 3)
    assert np.allclose(plain[0], same)  # part's y is the world's -x
    assert plain[1].sum(axis=0) == pytest.approx([0, 0, 2])  # int z over the box
    again = fcsim.build_model([body], loads=[fcsim.NodalForces("body", plain[1], factor=lambda t: 2.0)]).load(0.0)
    assert np.allclose(again.reshape(-1, 3), 2 * plain[1])
    K = fcsim.forms_of(part)
    assert abs(K.matrix(K.stiffness) - elasticity.stiffness(part)).max() < 1e-9 * abs(elasticity.stiffness(part)).max()
    assert abs(K.matrix(K.mass) - elasticity.consistent_mass(part)).max() < 1e-12


@pytest.mark.each_value
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(("cell", "d"), CELLS)
def test_forms_and_functions_on_the_users_own_mesh_are_loads(dolfinx: Any, cell: str, d: int, degree: int) -> None:
    """With a test function and a coefficient of one's own, on a mesh of first and of second order, in a body that is placed turned: what
    a form of the part's test function gives; a function that holds the vector is the same, though dolfinx numbers its entries its way."""
    import basix.ufl
    import ufl
    from mpi4py import MPI

    coarse = box(dolfinx, cell, d)
    points = coarse.geometry.x[:, :d]
    if degree == 2:
        W = dolfinx.fem.functionspace(coarse, ("Lagrange", 2))
        points = W.tabulate_dof_coordinates()[:, :d]
        element = basix.ufl.element("Lagrange", cell, 2, shape=(d,), dtype=np.float64)
        mesh = dolfinx.mesh.create_mesh(MPI.COMM_SELF, W.dofmap.list.astype(np.int64), element, points)
    else:
        mesh = coarse
    part = fcsim.part_from_dolfinx("part", mesh, SOFT, thickness=0.5 if d == 2 else 1.0)
    V = dolfinx.fem.functionspace(mesh, ("Lagrange", degree, (d,)))
    v, along = ufl.TestFunction(V), dolfinx.fem.Function(V)
    along.interpolate(lambda x: np.stack([x[0], *(np.full_like(x[0], 2.0),) * (d - 1)]))
    theirs = ufl.inner(along, v) * ufl.dx
    turn = np.eye(d)[[1, 0, 2][:d]] * np.array([-1.0, *(1.0,) * (d - 1)])[:, None]
    body = Body("body", part, rotation=turn)

    def of_part(p: Any) -> Any:
        return ufl.inner(ufl.as_vector((p.x[0], *(2.0,) * (d - 1))), p.v) * p.dx

    held = dolfinx.fem.assemble_vector(dolfinx.fem.form(theirs))
    vector = dolfinx.fem.Function(V)
    vector.x.array[:] = held.array * part.thickness
    given, expected = (fcsim.build_model([body], loads=[fcsim.FormLoad("body", f)]).load(0.0) for f in (theirs, of_part))
    assert np.allclose(given, expected, atol=1e-14)
    assert expected.any()
    as_vector = fcsim.build_model([Body("body", part)], loads=[fcsim.NodalForces("body", vector)]).load(0.0)
    plain = fcsim.build_model([Body("body", part)], loads=[fcsim.FormLoad("body", theirs)]).load(0.0)
    assert np.allclose(as_vector, plain, atol=1e-14)


def test_what_cannot_be_is_refused(dolfinx: Any) -> None:
    import ufl
    from mpi4py import MPI

    mesh = box(dolfinx, "tetrahedron", 3)
    cells = tags_of(dolfinx, mesh, 3, [lambda x: x[0] <= 1 + 1e-9, lambda x: x[0] >= 1 - 1e-9])
    facets = tags_of(dolfinx, mesh, 2, [lambda x: np.isclose(x[0], 0)])
    for options, message in (
        ({"material": {1: SOFT}, "cell_tags": cells}, r"a material for each tag .* got materials for \[1\], tags \[1, 2\]"),
        ({"material": {1: SOFT}}, "expected cell_tags"),
        ({"material": SOFT, "surfaces": {"left": 1}}, "expected facet_tags"),
        ({"material": SOFT, "facet_tags": facets, "surfaces": {"left": 7}}, r"tags among \[1\], got \[7\]"),
        ({"material": SOFT, "facet_tags": cells}, "facet_tags of dimension 2, got 3"),
    ):
        with pytest.raises(InputError, match=message):
            fcsim.part_from_dolfinx("part", mesh, **options)
    prism = dolfinx.mesh.create_box(MPI.COMM_SELF, [(0, 0, 0), (1, 1, 1)], (1, 1, 1), dolfinx.mesh.CellType.prism)
    with pytest.raises(InputError, match="got prism cells"):
        fcsim.part_from_dolfinx("part", prism, SOFT)
    with pytest.raises(InputError, match=r"expected a dolfinx\.mesh\.Mesh, got 'beam.xdmf'"):
        fcsim.part_from_dolfinx("part", "beam.xdmf", SOFT)  # type: ignore[arg-type]
    single = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 1, 1, dtype=np.float32)
    with pytest.raises(InputError, match="coordinates of float64, got float32"):
        fcsim.part_from_dolfinx("part", single, SOFT)
    body = Body("body", brick("part", (1.0, 1.0, 1.0), (1, 1, 1), SOFT))
    forms = fcsim.forms_of(body.part)
    with pytest.raises(InputError, match="a linear form of v, got a form of 2 arguments"):
        forms.vector(forms.mass)
    V = dolfinx.fem.functionspace(mesh, ("Lagrange", 1, (3,)))
    own = ufl.TestFunction(V)[0] * ufl.dx
    for load, message in (
        (fcsim.FormLoad("body", lambda p: p.x[0] * ufl.dx(domain=p.mesh)), "expected a linear form of v in UFL"),
        (fcsim.FormLoad("body", lambda p: 1 / 0), "ZeroDivisionError"),
        (fcsim.FormLoad("body", lambda p: ufl.inner(p.u, p.v) * p.dx), "got a form of 2 arguments"),
        (fcsim.FormLoad("body", lambda p: "pressure"), "got an object of class str"),
        (fcsim.FormLoad("body", own), r"on the dolfinx mesh \(this part has none of its own\), got one of .* on another mesh"),
        (fcsim.NodalForces("body", dolfinx.fem.Function(V)), "on another mesh"),
        (fcsim.NodalForces("body", dolfinx.fem.Function(V).x), "of a bare vector are in the order of its space"),
        (fcsim.NodalForces("body", np.zeros((3, 3))), r"finite forces of shape \(8, 3\)"),
        (fcsim.NodalForces("stop", np.zeros((8, 3))), "expected a deformable body"),
    ):
        with pytest.raises(InputError, match=message):
            fcsim.build_model([body, rigid_box("stop", (1, 1, 1), (5, 5, 5), 1.0)], loads=[load]).load(0.0)
    model = fcsim.build_model([body, rigid_box("stop", (1, 1, 1), (5, 5, 5), 1.0)])
    x = np.zeros(model.n_dofs)
    for name, field, message in (
        ("stop", "displacement", "got a rigid one"),
        ("body", "colour", "got 'colour'"),
        ("none", "stress", "'none'"),
    ):
        with pytest.raises(InputError, match=message):
            body_function(model, name, x, x, field)  # type: ignore[arg-type]


def test_stress_and_variables_of_laws_of_points(dolfinx: Any) -> None:
    """Two laws by cell tags: neo-Hooke's sigma = mu / J (b - 1) + lambda ln J / J, along the world's axes of a body placed turned; von
    Mises plasticity in pure shear keeps sigma_xy = sy / sqrt(3), with its plastic strain, nan where there is none."""
    from fcsim.mesh.material import Plastic, neo_hooke

    mesh = box(dolfinx, "quadrilateral", 2)
    cells = tags_of(dolfinx, mesh, 2, [lambda x: x[0] <= 1 + 1e-9, lambda x: x[0] >= 1 - 1e-9])
    E, nu, sy = 1e6, 0.3, 10.0
    part = fcsim.part_from_dolfinx("part", mesh, {1: neo_hooke(E, nu, 1.0), 2: Plastic(E, nu, 1.0, sy)}, cell_tags=cells)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    model = fcsim.build_model([Body("body", part, rotation=turn)], kinematics="linear")
    g = 1e-4  # beside rubber the plastic cells have Green and Lagrange's strain
    u = np.zeros_like(part.points)
    u[:, 0] = g * part.points[:, 1]  # simple shear F = 1 + g e1 e2 of the part
    x = (u @ turn.T).ravel()
    internal = model.nonlinear.inner(x, None, 0.0, 1.0).variables
    stress, mises, plastic = (
        body_function(model, "body", x, x, field, internal) for field in ("stress", "von_mises", "equivalent_plastic_strain")
    )
    assert stress.function_space.mesh is mesh
    values = stress.x.array.reshape(-1, 3, 3)[stress.function_space.dofmap.list[:, 0]]
    rubber = cells.find(1)
    mu = E / (2 * (1 + nu))
    in_part = mu * np.array([[g * g, g, 0], [g, 0, 0], [0, 0, 0]])  # J = 1
    R = np.eye(3)
    R[:2, :2] = turn
    assert values[rubber] == pytest.approx(np.tile(R @ in_part @ R.T, (len(rubber), 1, 1)), abs=1e-8 * mu * g)
    steel = cells.find(2)
    assert np.abs(values[steel][:, 0, 1]) == pytest.approx(np.full(len(steel), sy / 3**0.5), rel=1e-4)
    own = plastic.function_space.dofmap.list[:, 0]
    assert mises.x.array[mises.function_space.dofmap.list[:, 0]][steel] == pytest.approx(np.full(len(steel), sy), rel=1e-4)
    gamma = g - sy / 3**0.5 / mu  # the plastic shear
    assert plastic.x.array[own][steel] == pytest.approx(np.full(len(steel), gamma / 3**0.5), rel=1e-4)
    assert np.isnan(plastic.x.array[own][rubber]).all()
    with pytest.raises(InputError, match=r"von_mises, plastic_strain.*got 'colour'"):
        body_function(model, "body", x, x, "colour")
