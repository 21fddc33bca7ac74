"""Only bodies whose tangent has changed are factored anew."""

import numpy as np
import pytest

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly import body_factors
from fcsim.assembly.loads import Traction
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.general.everything import Everything
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.linear.factors import Factor, inverse_on
from fcsim.mesh.blocks import rectangle
from fcsim.mesh.material import neo_hooke
from fcsim.mesh.part import Body
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation


def test_a_body_that_nothing_strains_keeps_its_factor() -> None:
    """Three rubber squares apart from each other; one is pulled. The first problem has the factors of the beginning, later ones that of the
    pulled one anew where it has changed, and no other."""
    part = rectangle("square", (1.0, 1.0), (3, 3), neo_hooke(1.0, 0.3, 1.0))
    names = ["pulled", "idle", "other"]
    bodies = [Body(name, part, translation=(3.0 * k, 0.0)) for k, name in enumerate(names)]
    supports = [Support(name, (axis,), f"{axis}-") for name in names for axis in "xy"]
    model = build_model(bodies, supports=supports, loads=[Traction("pulled", "y+", (0.0, 0.3), factor=lambda t: t)])
    pair = SurfacePair(contact_surface(model, [("pulled", "x+")]), contact_surface(model, [("idle", "x-")]), 0.0, 1e-3)
    steps = list(Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(0.5), 2, witness=None))
    counts = [problem.factored for step in steps for problem in step.linearised]
    assert counts[0] <= len(names) and len(counts) > 4
    assert max(counts[1:]) == 1 and sum(counts[1:]) >= 3
    assert np.abs(steps[-1].state.x[model.dof_offset[1] : model.dof_offset[2]]).max() < 1e-12


@pytest.mark.parametrize("travel", [0.0, -0.05])
def test_compliances_are_made_where_contacts_touch_alone(monkeypatch: pytest.MonkeyPatch, travel: float) -> None:
    """A narrow square above the middle of a wide one, both of rubber: no column of A^-1 while nothing touches, and of the wide one no
    more than a third of its surface's when they do. W = H^T M^-1 H all the same, by a dense solution of the exported problem."""
    asked: list[int] = []

    def counted(unknowns: IntArray, factor: Factor, size: int) -> FloatArray:
        asked.append(len(unknowns))
        return inverse_on(unknowns, factor, size)

    monkeypatch.setattr(body_factors, "inverse_on", counted)
    rubber = neo_hooke(1.0, 0.3, 1.0)
    bed, punch = rectangle("bed", (4.0, 1.0), (24, 4), rubber), rectangle("punch", (0.5, 0.5), (3, 3), rubber)
    bodies = [Body("bed", bed), Body("punch", punch, translation=(1.75, 1.02))]
    held = [Support("bed", ("x", "y"), "y-"), Support("punch", ("x",), "y+")]
    model = build_model(bodies, supports=[*held, Support("punch", ("y",), "y+", velocity=travel)])
    (step,) = Simulation(model, Everything(model, mu=0.3), QuasiStatic(1.0), 1)
    if not travel:
        assert len(step.contacts) == 0 and not asked
        return
    assert len(step.contacts) >= 3
    surface = 2 * 2 * (24 + 4)  # dofs of the bed's nodes on its outline
    assert asked and all(count <= surface / 3 for count in asked)  # those of the punch, 24, are fewer than that
    problem = step.problem
    W = problem.H.T @ np.linalg.solve(problem.M.toarray(), problem.H.toarray())
    np.testing.assert_allclose(np.asarray(step.reduction.local.W), W, rtol=0, atol=1e-10 * np.abs(W).max())
