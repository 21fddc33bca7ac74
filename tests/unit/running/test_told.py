"""What files and descriptions say of a step and of a scheme."""

from types import SimpleNamespace
from typing import Any

import pytest

from fcsim.running.case_description import ignored
from fcsim.running.fclib_series import _length
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.theta import Theta


@pytest.mark.parametrize(
    ("parts", "h", "said"),
    [(1, 1e-3, "time step 0.001 s"), (4, 2.5e-4, "time step 0.00025 s, the last of 4 parts of a step that was cut")],
)
def test_the_length_that_is_in_M(parts: int, h: float, said: str) -> None:
    step: Any = SimpleNamespace(substeps=parts, scheme=SimpleNamespace(h=h))
    assert _length(step) == said


def test_damping_in_statics_is_said_to_do_nothing() -> None:
    def noted(beta: float, scheme: object) -> tuple[str, ...]:
        simulation: Any = SimpleNamespace(model=SimpleNamespace(beta=beta), scheme=scheme)
        return ignored(simulation)

    assert noted(0.05, QuasiStatic(0.25)) == ("the model's damping (beta = 0.05 s) does nothing in statics",)
    assert noted(0.0, QuasiStatic(0.25)) == () == noted(0.05, Theta(1e-3))
