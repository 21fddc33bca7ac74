"""The friction plate: GRECO's benchmark, SSNV128 of code_aster, in plane strain.

Half of an 80 x 40 mm plate, E = 1.3e11 Pa, nu = 0.2, on a rigid foundation with mu = 1; 5e7 Pa down on its top, 15e7 Pa on the face x = 0,
u_x = 0 in the plane of symmetry x = 40 mm. The table's displacements along the foundation were computed with 64 x 64 elements of second
order. Only contact holds the plate up, so a mass regularisation is needed: load steps without change of load make it die out.
"""

from functools import cache

import numpy as np
import pytest

from fcsim.assembly.loads import Traction
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

SIDE, TOP, FACE = 0.04, 5e7, 15e7
X = np.array([0, 1.25, 5, 7.5, 11.25]) * 1e-3
TABLE = np.array([2.861, 2.724, 2.288, 1.982, 1.542]) * 1e-5


@cache
def pushed(n: int, cell: str = "quadrilateral", eta: float = 1e6, ramp: int = 1) -> tuple[Step, np.ndarray]:
    """The last step, and u_x at the points of the table, interpolated between the nodes on the foundation.

    eta M / h^2 with h = 1 / ramp is 1e-4 of K (12 kg against 1e11 N/m) for eta = 1e6 and ramp = 1.
    """
    part = rectangle("plate", (SIDE, SIDE), (n, n), Material(1.3e11, 0.2, 7800.0), cell)

    def factor(t: float) -> float:
        return min(t, 1.0)

    model = build_model(
        [Body("plate", part), rigid_rectangle("foundation", (0.2, 0.04), (0.04, -0.02), 1.0)],
        supports=[Support("plate", ("x",), "x+"), Support("foundation", ("x", "y", "rz"))],
        loads=[Traction("plate", "y+", (0, -TOP), factor), Traction("plate", "x-", (FACE, 0), factor)],
    )
    pair = SurfacePair(contact_surface(model, [("plate", "y-")]), contact_surface(model, [("foundation", "y+")]), 1.0, 1e-3)
    scheme = QuasiStatic(1 / ramp, eta=eta / ramp**2)
    settings = SolverSettings(name="NSN-AC-HYBRID", tol=1e-9, floor=1e-7)
    last = list(Simulation(model, Detector([pair], model.n_nodes), scheme, ramp + 3, settings))[-1]
    low = np.unique(part.surfaces["y-"])
    low = low[np.argsort(part.points[low, 0])]
    return last, np.interp(X, part.points[low, 0], last.state.x[2 * low])


@pytest.mark.parametrize(("n", "cell"), [(16, "quadrilateral"), (32, "quadrilateral"), (32, "triangle")])
def test_displacements_along_the_foundation(n: int, cell: str) -> None:
    """Within a tenth (triangles a fifth) of an element, relative to the side: the corners' singularities leave an error of order h."""
    _, found = pushed(n, cell)
    assert np.abs(found / TABLE - 1).max() <= (0.1 if cell == "quadrilateral" else 0.2) / n


def test_forces_balance_and_obey_coulomb() -> None:
    last, _ = pushed(32)
    force = last.contact_force_on(0)
    support = last.support_impulse[: 2 * 33 * 33].reshape(-1, 2).sum(axis=0)
    assert force[1] == pytest.approx(TOP * SIDE, rel=1e-6)
    assert force[0] + support[0] == pytest.approx(-FACE * SIDE, rel=1e-6)
    normal, tangential = last.contact_force.T
    assert np.all(normal >= 0) and np.all(np.abs(tangential) <= normal + 1e-6 * normal.max())
    assert force[0] < 0  # friction resists the push


def test_neither_regularisation_nor_load_steps_matter() -> None:
    """The regularisation acts only while the plate moves; the load is proportional, and so is the answer."""
    _, found = pushed(32)
    for other in (pushed(32, eta=1e5), pushed(32, eta=1e7), pushed(32, ramp=5)):
        assert np.abs(other[1] / found - 1).max() <= 1e-4
        assert np.abs(other[0].state.x - other[0].previous.x).max() <= 1e-4 * TABLE[0]
