"""What ranks make together before one writes asks nothing of a rolling problem that it does not have: the writer refuses its local form."""

from __future__ import annotations

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import ExactContacts
from fcsim.contact_law import Gap, Rolling
from fcsim.mesh.exact.rigid_shapes import rigid_plane, rigid_sphere
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.running.outputs import RunOptions
from fcsim.running.run import _made_together
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta


def test_no_local_form_is_asked_for() -> None:
    model = build_model(
        [rigid_sphere("ball", 0.05, (0, 0, 0.05), 1.0), rigid_plane("ground", (0, 0, 0), (0, 0, 1))],
        supports=[Support("ground", ("x", "y", "z", "rx", "ry", "rz"))],
        gravity=lambda t: (3.0, 0.0, -9.81),
    )
    law, settings = Rolling(0.005, Gap()), SolverSettings(name="auto", tol=1e-8)
    (step,) = Simulation(model, ExactContacts(model, 0.4), Theta(4e-3, law=law), 1, settings)
    assert isinstance(step.problem, GlobalRollingProblem)
    _made_together(step, RunOptions(export_every=1, export_forms=("global", "local")))
