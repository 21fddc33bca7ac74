"""Bodies of second order in contact and in time: rest on a floor, spin freely, friction, VTK files; curved contact by Hertz."""

from typing import Any

import numpy as np
import pytest

import fcsim
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import Body, Material, brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.cell_type import CELL_TYPES, ELEMENTS, RAISED

SOFT = Material(1e7, 0.3, 1000.0)


def block(cell: str) -> Any:
    elements = ELEMENTS[RAISED[cell]][0]
    if CELL_TYPES[cell].dimension == 3:
        return brick("block", (1.0, 1.0, 0.5), (2, 2, 1), SOFT, cell, origin=(-0.5, -0.5, 0.0), elements=elements)
    return rectangle("block", (1.0, 0.5), (2, 1), SOFT, cell, origin=(-0.5, 0.0), elements=elements)


def resting(cell: str, detection: str) -> list[fcsim.Step]:
    """A block set down on a fixed rigid floor: quasi-statics, its weight by gravity, eta small."""
    d = CELL_TYPES[cell].dimension
    floor = rigid_box("floor", (3.0, 3.0, 1.0), (0, 0, -0.5), 1.0) if d == 3 else rigid_rectangle("floor", (3.0, 1.0), (0, -0.5), 1.0)
    model = fcsim.build_model(
        [Body("block", block(cell)), floor],
        supports=[fcsim.Support("floor", DIRECTIONS[d])],
        gravity=lambda t: (*(0.0,) * (d - 1), -10.0),
    )
    if detection == "everything":
        detector: Any = fcsim.Everything(model, 0.5)
    else:
        low, high = ("z-", "z+") if d == 3 else ("y-", "y+")
        pair = fcsim.SurfacePair(
            fcsim.contact_surface(model, [("block", low)]), fcsim.contact_surface(model, [("floor", high)]), 0.5, 0.01, detection
        )
        detector = fcsim.Detector([pair], model.n_nodes)
    return list(fcsim.Simulation(model, detector, fcsim.QuasiStatic(1.0, eta=1e-4), 3))


@pytest.mark.parametrize("detection", ["nodes", "mortar", "everything"])
@pytest.mark.parametrize("cell", list(RAISED))
def test_a_block_at_rest_bears_its_weight(cell: str, detection: str) -> None:
    """Statics: the floor's reaction is the weight; with "mortar" the stress is that of the column, sigma = - rho g (H - z)."""
    step = resting(cell, detection)[-1]
    d = step.model.dimension
    weight = 1000 * 10 * 0.5
    assert step.contact_force_on(0)[-1] == pytest.approx(weight, rel=1e-6)
    assert np.abs(step.contact_force_on(0)[: d - 1]).max() < 1e-6 * weight
    assert -step.energy.residual < 1e-9 * weight
    if detection == "mortar":
        part = step.model.deformable[0].part
        from fcsim.assembly.stress import stress_at

        at = CELL_TYPES[part.cell_type].inside
        stress = (stress_at(part, at) @ step.state.x[: part.points.size]).reshape(len(part.cells), len(at), 6)
        z = np.einsum("qa,ca->cq", CELL_TYPES[part.cell_type].shape(at), part.points[part.cells][..., -1])
        inner = -1000 * 10 * (0.5 - z)
        assert np.abs(stress[..., d - 1] - inner).max() < 0.35 * weight  # friction below keeps it from spreading freely
        assert stress[..., d - 1].mean() == pytest.approx(inner.mean(), rel=0.05)


@pytest.mark.each_value
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("lumped", [True, False])
def test_free_spin_keeps_energy_and_angular_momentum(cell: str, lumped: bool) -> None:
    """A turning block of second order spun at 10 rad/s for a full turn: no stress by rotation but the centrifugal one."""
    model = fcsim.build_model([Body("block", block(cell))], lumped=lumped)
    x = model.reference - model.reference.mean(axis=0)
    v = np.cross([0.0, 0.0, 10.0], x).ravel()
    state = fcsim.State(0.0, np.zeros(model.n_dofs), v)
    simulation = fcsim.Simulation(model, fcsim.Everything(model, 0.0), fcsim.Theta(8e-3), 79, initial=state, witness=None)
    moments, energies = [], []
    for step in simulation:
        p = model.apply_mass(step.state.v).reshape(-1, 3)
        y = model.reference + step.state.x.reshape(-1, 3)
        moments.append(np.cross(y, p).sum(axis=0))
        energies.append(step.energy.kinetic + step.energy.elastic)
    assert np.ptp(np.array(moments), axis=0).max() < 1e-8 * np.abs(moments[0]).max()
    assert np.ptp(energies) < 1e-8 * energies[0]


def test_vtk_files_hold_quadratic_cells(tmp_path: Any) -> None:
    pyvista = pytest.importorskip("pyvista")
    from fcsim.running.vtk_series import SeriesWriter

    step = resting("tetrahedron", "nodes")[-1]
    series = SeriesWriter(tmp_path, step.model)
    series.write(step)
    grid = pyvista.read(next(tmp_path.glob("blocks_*.vtu")))
    assert set(grid.celltypes) == {24}
    assert grid.n_points == len(step.model.deformable[0].part.points)
    assert grid.compute_cell_sizes()["Volume"].sum() == pytest.approx(0.5)
    assert np.allclose(grid["displacement [m]"], step.state.x[: 3 * grid.n_points].reshape(-1, 3))
