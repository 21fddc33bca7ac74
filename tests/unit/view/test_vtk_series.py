"""The VTK series, read back by other programs (VTK's readers through pyvista, meshio), against what was handed in."""

import resource
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import pyvista

from fcsim.errors import InputError, MissingDependency
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part
from fcsim.running.folder import RunFolder, instants_in
from fcsim.running.series.bodies import closed_line
from fcsim.running.vtk_series import SeriesWriter
from fcsim.view.scene import read, survey

SOFT = Material(E=5.0, nu=0.25, density=1.0)


@pytest.fixture(params=[2, 3])
def written(request, fake, tmp_path):
    """(model, step, folder) of a wall of which one instant was written."""
    model = fake.wall(request.param, 4)
    step = fake.step(model, 10, 20, 4)
    SeriesWriter(tmp_path, model).write(step)
    return model, step, tmp_path


def times(directory, name="blocks"):
    entries = ElementTree.parse(directory / "run.pvd").getroot().iter("DataSet")
    return [(float(e.attrib["timestep"]), e.attrib["file"]) for e in entries if e.attrib["name"] == name]


def test_blocks_hold_the_reference_mesh_and_the_displacement(written):
    model, step, directory = written
    blocks = pyvista.read(directory / "blocks_00010.vtu")
    n = model.node_offset[12]  # the 12 blocks come before the platens
    d = model.dimension
    assert blocks.n_points == n
    assert blocks.n_cells == sum(len(body.part.cells) for body in model.bodies[:12])
    assert set(blocks.celltypes) == {12 if d == 3 else 9}  # VTK_HEXAHEDRON, VTK_QUAD
    np.testing.assert_array_equal(blocks.points[:, :d], model.reference[:n])
    np.testing.assert_array_equal(blocks["displacement [m]"][:, :d], step.state.x.reshape(-1, d)[:n])
    np.testing.assert_array_equal(blocks["velocity [m/s]"][:, :d], step.state.v.reshape(-1, d)[:n])
    if d == 2:
        assert not blocks["displacement [m]"][:, 2].any() and not blocks.points[:, 2].any()
    np.testing.assert_array_equal(blocks["body"], np.repeat(np.arange(12), [len(body.part.cells) for body in model.bodies[:12]]))
    size = blocks.compute_cell_sizes(length=False, area=d == 2, volume=d == 3)["Volume" if d == 3 else "Area"]
    assert size.min() > 0 and size.sum() == pytest.approx(0.7 * 0.3 * (0.1 if d == 3 else 1))  # wall.md's wall, every cell the right way up


def test_meshio_reads_the_same_blocks(written):
    model, step, directory = written
    mesh = meshio.read(directory / "blocks_00010.vtu")
    d, n = model.dimension, model.node_offset[12]
    np.testing.assert_array_equal(mesh.points[:, :d], model.reference[:n])
    np.testing.assert_array_equal(mesh.point_data["displacement [m]"][:, :d], step.state.x.reshape(-1, d)[:n])
    expected = np.concatenate([body.part.cells + first for body, first in zip(model.bodies[:12], model.node_offset, strict=False)])
    np.testing.assert_array_equal(mesh.cells_dict["hexahedron" if d == 3 else "quad"], expected)


def test_contacts_hold_reaction_gap_and_status(written):
    model, step, directory = written
    points, contacts, d = pyvista.read(directory / "contacts_00010.vtp"), step.contacts, model.dimension
    assert points.n_points == points.n_verts == len(contacts)
    displacement = step.state.x.reshape(-1, d)
    for a in range(len(contacts)):
        in_space = sum(step.contact_force[a, k] * contacts.frame[a, k] for k in range(d))
        np.testing.assert_allclose(points["reaction [N]"][a, :d], in_space, atol=1e-12)
        np.testing.assert_array_equal(points["displacement [m]"][a, :d], displacement[contacts.nodes[a, 1]])  # its node of weight -1
    tangential = np.sqrt(np.sum(points["reaction [N]"] ** 2, axis=1) - points["reaction_normal [N]"] ** 2)
    np.testing.assert_allclose(points["reaction_tangential [N]"], tangential, atol=1e-5)
    np.testing.assert_array_equal(points["reaction_normal [N]"], step.contact_force[:, 0])
    np.testing.assert_array_equal(points["gap [m]"], contacts.gap)
    np.testing.assert_array_equal(points.field_data["overlap [m]"], [2e-4])
    np.testing.assert_array_equal(points.field_data["overlap_place [m]"], [[0.1, 0.1, 0.1 * (d == 3)]])
    np.testing.assert_array_equal(points["status"], step.contact_status)
    np.testing.assert_array_equal(points["mu"], contacts.mu)
    np.testing.assert_array_equal(points["normal"][:, :d], contacts.frame[:, 0])
    np.testing.assert_array_equal(points["sliding_velocity [m/s]"], np.abs(step.result.u.reshape(-1, d)[:, 1]))  # the fake slides along T1
    assert set(points["status"]) == {0, 1, 2}


def test_rigid_surfaces(written):
    model, step, directory = written
    rigid, d = pyvista.read(directory / "rigid_00010.vtp"), model.dimension
    assert rigid.n_cells == (2 * 6 if d == 3 else 2)  # the contact surface repeats a facet of the box: taken once; 2D: the outline
    assert rigid.n_lines == 0
    np.testing.assert_array_equal(rigid.points[:, :d], model.reference[model.node_offset[12] :])
    np.testing.assert_array_equal(rigid["displacement [m]"][:, :d], step.state.x.reshape(-1, d)[model.node_offset[12] :])
    assert set(rigid["body"]) == {12, 13}
    if d == 3:
        assert rigid.volume == pytest.approx(2 * 0.76 * 0.14 * 0.04)
    else:
        assert rigid.area == pytest.approx(2 * 0.76 * 0.04)


@pytest.mark.parametrize(
    ("segments", "line"),
    [
        ([(0, 1), (3, 0), (1, 2), (2, 3)], [0, 1, 2, 3]),
        ([(0, 1), (1, 2), (2, 3)], None),  # open
        ([(0, 1), (1, 0), (2, 3), (3, 2)], None),  # a ring: two lines
        ([(0, 1), (2, 1), (2, 0)], None),  # not all one way
        ([(1, 2), (2, 3), (3, 2)], None),  # a loop at the end of a line
        ([], None),
    ],
)
def testclosed_lines(segments, line):
    assert closed_line(segments) == line


@pytest.mark.parametrize("d", [2, 3])
def test_von_mises_of_stretched_bodies_in_any_placement(d, fake, tmp_path):
    # uniaxial strain eps along the part's x: s_xx - s_yy = 2 mu eps, s_yy = s_zz (plane strain too), so von Mises = E eps / (1 + nu)
    box = fake.brick("box", 0.2, (2, 1, 1))
    if d == 2:
        cells = [(0, 1, 2, 3), (1, 4, 5, 2)]
        points = np.array([(0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1), (0.2, 0), (0.2, 0.1)])
        parts = [
            Part("plane", points, cells, "quadrilateral", {}, SOFT),
            Part("tri", points[:3], [(0, 1, 2)], "triangle", {}, SOFT),
        ]
    else:
        parts = [Part("box", box.points, box.cells, "hexahedron", {}, SOFT)]
        parts.append(Part("tet", np.vstack([np.zeros(3), np.eye(3)]), [(0, 1, 2, 3)], "tetrahedron", {}, SOFT))
    placements, strains = [], [1e-3, 3e-3, -2e-3, 5e-4]
    rng = np.random.default_rng(1)
    for _ in strains:
        q = np.linalg.qr(rng.normal(size=(d, d)))[0]
        placements.append(q * np.array([np.linalg.det(q)] + [1] * (d - 1)))
    order = [parts[0], parts[1], parts[0], parts[1]]  # parts of two kinds, interleaved
    bodies = tuple(Body(f"b{k}", p, R, rng.normal(size=d)) for k, (p, R) in enumerate(zip(order, placements, strict=True)))
    model = fake.model(bodies)
    along = [body.part.points * [e] + 0 for body, e in zip(bodies, strains, strict=True)]
    x = np.concatenate([np.outer(u[:, 0], R[:, 0]) + [0.3] * d for u, R in zip(along, placements, strict=True)])
    step = fake.without_contacts(fake.step(fake.wall(d, 4), 10, 20, 4))
    step.state.x, step.state.v = x.ravel(), x.ravel()
    SeriesWriter(tmp_path, model).write(step)

    blocks = pyvista.read(tmp_path / "blocks_00010.vtu")
    for k, strain in enumerate(strains):
        np.testing.assert_allclose(blocks["von_mises [Pa]"][blocks["body"] == k], 5.0 * abs(strain) / 1.25, rtol=1e-9)
    assert pyvista.read(tmp_path / "contacts_00010.vtp").n_points == 0  # a step without contacts has its file too
    assert not times(tmp_path, "rigid")


@pytest.mark.parametrize("moved", ["fallen", "at rest"])
def test_round_off_is_not_drawn_as_stress(moved, fake, tmp_path):
    """A block that has fallen 1.8 m is free of stress, as is one that nothing loads: what is left of round-off, in the second of a solver,
    was drawn in all colours up to the darkest."""
    box = fake.brick("box", 0.2, (3, 2, 2))
    steel = Part("box", box.points, box.cells, "hexahedron", {}, Material(E=2e11, nu=0.3, density=8e3))
    model = fake.model((Body("falls", steel, np.eye(3), np.array([0.0, 0.0, 10.0])),))
    step = fake.without_contacts(fake.step(fake.wall(3, 4), 10, 20, 4))
    left = np.random.default_rng(7).normal(size=box.points.size) * 1e-40
    step.state.x = step.state.v = np.tile([0.0, 0.0, -0.5 * 9.81 * 0.6**2], len(box.points)) if moved == "fallen" else left
    SeriesWriter(tmp_path, model).write(step)
    instants = instants_in(tmp_path)
    seen = survey(RunFolder(tmp_path, None, {}, instants), instants)
    assert 0 < read(instants[0].blocks)["von_mises"].max() < 0.1 * seen.stress[1] < 1e-12 * 2e11


def test_collection_has_times_and_files(fake, tmp_path):
    model = fake.wall(3, 4)
    writer = SeriesWriter(tmp_path, model)
    for number in (5, 10, 15):
        writer.write(fake.step(model, number, 20, 4))
    for name, suffix in (("blocks", "vtu"), ("contacts", "vtp"), ("rigid", "vtp")):
        expected = [(0.125, f"{name}_00005.{suffix}"), (0.25, f"{name}_00010.{suffix}"), (0.375, f"{name}_00015.{suffix}")]
        assert times(tmp_path, name) == expected
    reader = pyvista.get_reader(tmp_path / "run.pvd")
    assert list(reader.time_values) == [0.125, 0.25, 0.375]
    reader.set_active_time_value(0.375)
    np.testing.assert_array_equal(reader.read()[0]["displacement [m]"], fake.displacement(model, 0.75)[: model.node_offset[12]])


def test_a_continued_run_keeps_earlier_entries_and_drops_later_ones(fake, tmp_path):
    model = fake.wall(3, 4)
    first = SeriesWriter(tmp_path, model)
    for number in (5, 10, 15):
        first.write(fake.step(model, number, 20, 4))
    again = SeriesWriter(tmp_path, model)  # from a checkpoint at step 9
    assert len(times(tmp_path)) == 3  # opening changes nothing
    again.write(fake.step(model, 10, 20, 4))
    assert [t for t, _ in times(tmp_path)] == [0.125, 0.25]
    again.write(fake.step(model, 20, 20, 4))
    for name in ("blocks", "contacts", "rigid"):
        assert [t for t, _ in times(tmp_path, name)] == [0.125, 0.25, 0.5]
        assert all((tmp_path / file).is_file() for _, file in times(tmp_path, name))


def test_a_broken_collection_is_refused(fake, tmp_path):
    (tmp_path / "run.pvd").write_text("<VTKFile><Coll")
    with pytest.raises(InputError, match=r"run\.pvd.*ParaView collection"):
        SeriesWriter(tmp_path, fake.wall(3, 4))


def test_a_write_that_fails_leaves_no_half_file(fake, tmp_path):
    model = fake.wall(3, 4)
    writer = SeriesWriter(tmp_path, model)
    writer.write(fake.step(model, 5, 20, 4))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))  # as a full disk: every larger file fails in the middle
    try:
        with pytest.raises(OSError, match="could not write"):
            writer.write(fake.step(model, 10, 20, 4))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_without_vtk_the_extra_is_named(fake, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "vtkmodules.vtkIOXML", None)
    with pytest.raises(MissingDependency, match=r"pip install 'fcsim\[view\]'"):
        SeriesWriter(tmp_path, fake.wall(3, 4))
