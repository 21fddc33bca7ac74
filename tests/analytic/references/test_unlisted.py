"""Classical problems of no list: a spinning disc, the punch of Prandtl, two rods that strike each other."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Body, Everything, FormLoad, QuasiStatic, Simulation, Support, Theta, at_rest, build_model
from fcsim.mesh import rectangle
from fcsim.mesh.material import Material, Plastic
from tests.analytic.references.meshes import block, sector, spaced


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_disc_with_a_hole_that_spins(unit: float) -> None:
    """S. Timoshenko, J. N. Goodier, Theory of elasticity, section 32: hoop stress (3 + nu) / 4 rho w^2 (b^2 + (1 - nu) / (3 + nu) a^2) at
    the hole, by its widening u = a sigma / E; the load a form of the user's."""
    a, b, E, nu, rho, w = 0.1 * unit, 0.3 * unit, 2.1e11 / unit, 0.3, 7800.0 / unit**3, 1000.0
    part = block("disc", [spaced(0, 1, 6), spaced(0, 1, 6)], Material(E, nu, rho), "Q2", sector(a, b, 0.0, 0.5 * np.pi), plane="stress")

    def centrifugal(p):  # type: ignore[no-untyped-def]
        return rho * w**2 * (p.x[0] * p.v[0] + p.x[1] * p.v[1]) * p.dx

    supports = [Support("disc", ("y",), "y-"), Support("disc", ("x",), "y+")]
    model = build_model([Body("disc", part)], supports=supports, loads=[FormLoad("disc", centrifugal)])
    *_, last = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1)
    hoop = (3 + nu) / 4 * rho * w**2 * (b**2 + (1 - nu) / (3 + nu) * a**2)
    widened = np.linalg.norm(last.state.x.reshape(-1, 2)[np.unique(part.surfaces["x-"])], axis=1)
    assert_allclose(widened, a * hoop / E, rtol=1e-3)


@pytest.mark.slow
def test_the_punch_of_prandtl() -> None:
    """L. Prandtl (1920): a punch on perfectly plastic ground sinks at the pressure (2 + pi) k, k = sigma_y / sqrt(3), in plane strain. From
    above, since the mesh is one of displacements, and the punch is wider by part of a cell: 5 % with six cells under half of it."""
    n, sy = 6, 1.0
    ground = rectangle("ground", (5.0, 3.0), (5 * n, 3 * n), Plastic(1e3, 0.3, 1.0, sy), elements="Q1-bbar")
    top = ground.surfaces["y+"]
    under = top[np.all(ground.points[top][..., 0] <= 1 + 1e-9, axis=1)]
    part = replace(ground, surfaces={**ground.surfaces, "punch": under})
    supports = [
        Support("ground", ("x",), "x-"),
        Support("ground", ("x", "y"), "y-"),
        Support("ground", ("x",), "x+"),
        Support("ground", ("y",), "punch", velocity=-0.02),
    ]
    model = build_model([Body("ground", part)], supports=supports)
    steps = list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.1), 10, witness=None))
    pressure = [-step.support_impulse.reshape(-1, 2)[np.unique(under), 1].sum() for step in steps]
    limit = (2 + np.pi) * sy / np.sqrt(3)
    assert limit < pressure[-1] < 1.06 * limit
    assert pressure[-1] - pressure[-2] < 5e-3 * limit


@pytest.mark.slow
def test_two_equal_rods_strike_each_other() -> None:
    """B. de Saint-Venant (1867): they exchange their velocities in the time 2 L / c, under the force rho c A v / 2."""
    L, A, E, rho, v, n = 1.0, 0.02, 2e11, 7800.0, 1.0, 200
    c = np.sqrt(E / rho)
    rod = rectangle("rod", (L, A), (80, 1), Material(E, 0.0, rho), plane="stress")
    model = build_model([Body("a", rod, translation=(-L, 0.0)), Body("b", rod, translation=(1e-6, 0.0))])
    thrown = np.zeros(model.n_dofs)
    thrown[: model.dof_offset[1] : 2] = v
    steps = list(
        Simulation(model, Everything(model, mu=0.0), Theta(3 * L / c / n, 0.5), n, initial=replace(at_rest(model), v=thrown), witness=None)
    )
    force = np.array([-step.contact_force_on(0)[0] for step in steps])
    assert_allclose(np.count_nonzero(force > 0) * 3 * L / c / n, 2 * L / c, rtol=0.03)
    assert_allclose(np.median(force[force > 0]), 0.5 * rho * c * A * v, rtol=0.01)
    after = [steps[-1].state.v[model.dof_offset[k] : model.dof_offset[k + 1] : 2].mean() for k in (0, 1)]
    assert_allclose(after, [0.0, v], atol=0.03)
