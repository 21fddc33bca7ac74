"""Pins that are drawn out of their holes lose their contact step by step, which is no snap; a hook that slides off its edge is one."""

from collections.abc import Callable

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detection, Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh import Body
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import Material, neo_hooke
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.witness import Witness

ANYWHERE = Limits(rotation=np.inf, strain=np.inf, left_out=np.inf)
Law = Callable[[float, float, float], object]


def said(simulation: Simulation) -> list[tuple[float, float]]:
    """Times at which energy is said to be released, and how much [J]."""
    steps = list(simulation)
    assert any(step.contact_force.max(initial=0.0) > 0 for step in steps)
    told = [(step.state.t, remark) for step in steps for remark in step.remarks if "released" in remark]
    return [(t, float(remark.split(": ")[1].split(" J")[0])) for t, remark in told]


def plug(law: Law, mu: float, steps: int, rule: str) -> Simulation:
    """Half of a plug of 1.2 m, too thick by 1 mm, in a slot of 1 m; pressed in the first step, then drawn out by 1.2 m."""
    jaw, pin = (rectangle("jaw", (1.0, 0.5), (9, 4), law(1e9, 0.3, 1000.0)), rectangle("pin", (1.2, 0.251), (8, 2), law(1e9, 0.3, 1000.0)))
    supports = [Support("jaw", ("x", "y"), "y+"), Support("pin", ("y",), "y-")]
    supports.append(Support("pin", ("x",), "x+", displacement=lambda t: 1.2 * max(t - 1 / steps, 0.0)))
    model = build_model([Body("jaw", jaw, translation=(0.0, 0.25)), Body("pin", pin, translation=(0.1, 0.0))], supports=supports)
    detection: Detection = Everything(model, mu)
    if rule != "everything":
        top, under = contact_surface(model, [("pin", "y+")]), contact_surface(model, [("jaw", "y-")])
        detection = Detector([SurfacePair(top, under, mu, 0.02, rule)], model.n_nodes)
    return Simulation(model, detection, QuasiStatic(1 / steps), steps, limits=ANYWHERE, witness=Witness(initial="allow"))


@pytest.mark.parametrize(
    ("law", "mu", "steps", "rule"),
    [
        (Material, 0.0, 60, "everything"),
        (Material, 0.3, 20, "everything"),
        (Material, 0.0, 20, "nodes"),
        (Material, 0.3, 60, "mortar"),
        (Material, 0.0, 20, "segments"),
        (Material, 0.3, 20, "faces"),
        (neo_hooke, 0.3, 20, "everything"),
        (neo_hooke, 0.0, 20, "nodes"),
    ],
)
def test_a_plug_that_is_drawn_out_says_nothing(law: Law, mu: float, steps: int, rule: str) -> None:
    """Whatever finds its contacts: each point that left was named, since the last ones release all that is left."""
    assert not said(plug(law, mu, steps, rule))


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_peg_between_plates_in_space_says_nothing(unit: float) -> None:
    """In m, and in mm with MPa and tonnes."""
    stiff = Material(1e9 / (1.0 if unit == 1.0 else 1e6), 0.3, 1e-6 / unit)
    jaw = brick("jaw", (unit, 0.5 * unit, 0.5 * unit), (5, 1, 1), stiff)
    pin = brick("pin", (1.2 * unit, 0.4 * unit, 0.251 * unit), (6, 1, 1), stiff)
    supports = [Support("jaw", ("x", "y", "z"), "z+"), Support("pin", ("y", "z"), "z-")]
    supports.append(Support("pin", ("x",), "x+", displacement=lambda t: 1.2 * unit * max(t - 1 / 12, 0.0)))
    bodies = [Body("jaw", jaw, translation=(0.0, 0.0, 0.25 * unit)), Body("pin", pin, translation=(0.1 * unit, 0.05 * unit, 0.0))]
    model = build_model(bodies, supports=supports)
    witness = Witness(initial="allow")
    assert not said(Simulation(model, Everything(model, 0.3), QuasiStatic(1 / 12), 12, limits=ANYWHERE, witness=witness))


def test_points_that_leave_by_more_than_a_quarter_in_one_step_are_named() -> None:
    """A fifth of the length a step, by nodes without friction: contacts of a step's beginning hold more than is left at its end."""
    assert said(plug(Material, 0.0, 6, "nodes"))


@pytest.mark.parametrize(("law", "steps"), [(Material, 10), (Material, 40), (neo_hooke, 20)])
def test_a_hook_that_slides_off_its_edge_snaps(law: Law, steps: int) -> None:
    """A cantilever of 2 m, 0.1 m high, bent by w = 10 mm over a block's edge, drawn back until its end is there: it holds 3 E I w^2 / (2
    L^3), E that of plane strain, though it pressed twice as hard when its arm was 1.6 m."""
    beam = rectangle("beam", (2.0, 0.1), (20, 2), law(1e9, 0.3, 1000.0), elements="Q2")
    base = rectangle("base", (0.5, 0.5), (5, 5), law(1e12, 0.3, 1000.0))
    supports = [Support("base", ("x", "y"), "y-"), Support("beam", ("y",), "x-", displacement=lambda t: -0.01 * min(5 * t, 1.0))]
    supports.append(Support("beam", ("x",), "x-", displacement=lambda t: -0.8 * max(t - 0.2, 0.0)))
    model = build_model([Body("base", base, translation=(1.6, -0.5)), Body("beam", beam)], supports=supports)
    ((t, released),) = said(Simulation(model, Everything(model, 0.0), QuasiStatic(1 / steps), steps, limits=ANYWHERE))
    assert t == pytest.approx(0.2 + 0.4 / 0.8, abs=max(2.1 / steps, 0.055))  # on which step its end is off
    assert released == pytest.approx(3 * 1e9 / 0.91 * (0.1**3 / 12) * 0.01**2 / (2 * 2.0**3), rel=0.05)
