"""Statics whose tolerance, relative to how far bodies would fly without contact, is next to round-off: said, with the eta to take."""

from __future__ import annotations

import re

from fcsim import Body, Everything, Material, QuasiStatic, Simulation, Step, Support, build_model
from fcsim.mesh import brick

SAID = "round-off leaves so little"


def squeezed(eta: float) -> Step:
    """The first load step of a deformable block between two soft ones that come together; gravity draws it along them."""
    soft, hard = Material(1e5, 0.3, 1000.0), Material(1e8, 0.25, 2000.0)
    jaw, block = brick("jaw", (1.0, 0.6, 0.2), (5, 3, 2), soft), brick("block", (0.4, 0.3, 0.1), (3, 3, 1), hard)
    bodies = [Body("lower", jaw), Body("block", block, translation=(0.2, 0.15, 0.2)), Body("upper", jaw, translation=(0.0, 0.0, 0.3))]
    down = Support("upper", ("z",), "z+", displacement=lambda t: -7e-4 * t)
    supports = [Support("lower", ("x", "y", "z"), "z-"), Support("upper", ("x", "y"), "z+"), down, Support("block", ("x",), "x+")]
    model = build_model(bodies, supports=supports, gravity=(0.0, 0.0, -9.81))
    (step,) = Simulation(model, Everything(model, mu=0.3), QuasiStatic(1.0, eta=eta), 1)
    return step


def test_next_to_round_off_a_run_names_the_eta_that_leaves_digits() -> None:
    """With eta = 1e-6 the block would fall g h^2 / eta = 9.8e6 m; of that 1e-8 of the model's 1 m is 1e-15."""
    scarce = squeezed(1e-6)
    (text,) = (text for text in scarce.remarks if SAID in text)
    found = re.search(r"a larger eta \(about (\S+) times\)", text)
    assert found is not None and 0.5e-12 < scarce.attempts[-1].tol * float(found[1]) < 2e-12
    enough = squeezed(1e-6 * float(found[1]))
    assert not any(SAID in text for text in enough.remarks)
    assert enough.result.iterations < scarce.result.iterations / 5
