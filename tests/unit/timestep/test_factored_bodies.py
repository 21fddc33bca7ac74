"""Only bodies whose tangent has changed are factored anew."""

import numpy as np

from fcsim.assembly.loads import Traction
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
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
