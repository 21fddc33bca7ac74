"""What files and descriptions say of a step and of a scheme."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.export_fclib import read_fclib
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.problem import GlobalProblem
from fcsim.running.case_description import ignored
from fcsim.running.fclib_series import write_step
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta


def test_the_length_that_is_in_M(tmp_path: Path) -> None:
    """A step that is too much for Newton's method is cut; M = M_0 + (beta theta h + theta^2 h^2) K has the written part's h."""
    beta, theta, whole = 1e-3, 0.5, 0.1
    model = build_model(
        [
            Body("block", brick("block", (1.0, 0.4, 0.3), (4, 3, 2), Material(1e6, 0.3, 1000.0))),
            rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0),
        ],
        supports=[
            Support("plane", ("x", "y", "z", "rx", "ry", "rz")),
            Support("block", ("z",), "z+", velocity=-0.01),
            Support("block", ("x",), "z+", velocity=lambda t: 0.04 * (t > 0.5)),
            Support("block", ("y",), "z+"),
        ],
        beta=beta,
    )
    solver = SolverSettings(name="NSN-AC", options={"max_iterations": 2}, fallback=())
    steps = list(Simulation(model, Everything(model, 0.5), Theta(whole, theta), 10, solver))
    parts = {step.substeps for step in steps}
    assert 1 in parts and max(parts) > 1  # some were cut, some were not
    for step in steps:
        (path,) = write_step(tmp_path, step, "part")
        file = read_fclib(path)
        h = step.scheme.h
        assert isinstance(file.problem, GlobalProblem) and h == whole * step.attempts[-1].share
        M = model.matrix(1.0, beta * theta * h + (theta * h) ** 2)[model.free_dofs][:, model.free_dofs].toarray()
        found = sp.csr_array(file.problem.M).toarray()
        assert_allclose(found, M, rtol=1e-12, atol=1e-12 * np.abs(M).max())
        said = f"time step {h:.6g} s" + (f", the last of {step.substeps} parts of a step that was cut" if step.substeps > 1 else "")
        assert file.info.math_info.endswith(said)


def test_damping_in_statics_is_said_to_do_nothing() -> None:
    def noted(beta: float, scheme: object) -> tuple[str, ...]:
        simulation: Any = SimpleNamespace(model=SimpleNamespace(beta=beta), scheme=scheme)
        return ignored(simulation)

    assert noted(0.05, QuasiStatic(0.25)) == ("the model's damping (beta = 0.05 s) does nothing in statics",)
    assert noted(0.0, QuasiStatic(0.25)) == () == noted(0.05, Theta(1e-3))
