"""Contacts that a long step of statics loses: bodies that stand in one another, with nothing between them, are no answer."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import NotConverged
from fcsim.mesh.blocks import rectangle
from fcsim.mesh.material import Material, neo_hooke
from fcsim.mesh.part import Body
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.witness.overlap import measure
from fcsim.witness.skin import skins_of


def drawn(slide: float, steps: int, h: float = 1.0, cuttings: int = 5, start: float = 0.6, linear: bool = False) -> Simulation:
    """A punch from x = start to start + 0.5, pressed by 0.3 into a bed of 4 until t = 2, then drawn along its facets of 1/6 by `slide` a
    second."""
    law: Any = Material if linear else neo_hooke
    bed = rectangle("bed", (4.0, 1.0), (24, 6), law(1e6, 0.3, 1.0))
    punch = rectangle("punch", (0.5, 0.5), (4, 4), law(1e7, 0.3, 1.0))
    supports = [
        Support("bed", ("x", "y"), "y-"),
        Support("punch", ("y",), "y+", velocity=lambda t: -0.15 if t < 2 else 0.0),
        Support("punch", ("x",), "y+", velocity=lambda t: slide if t > 2 else 0.0),
    ]
    model = build_model([Body("bed", bed), Body("punch", punch, translation=(start, 1.0))], supports=supports)
    surfaces = (contact_surface(model, [of]) for of in (("punch", "y-"), ("bed", "y+")))
    detection = Detector([SurfacePair(*surfaces, 0.0, 0.05, normals="smooth")], model.n_nodes)
    anywhere = Limits(rotation=np.inf, strain=np.inf, left_out=np.inf)
    return Simulation(model, detection, QuasiStatic(h), steps, limits=anywhere, witness=None, cuttings=cuttings)


def vertical(simulation: Simulation) -> dict[float, float]:
    """The force of the punch's top [N] by time; bodies overlap by less than 2 % after each step."""
    model, skins = simulation.model, skins_of(simulation.model)[0]
    top = model.dof_of_node[np.unique(model.facets("punch", "y+"))]
    found = {}
    for step in simulation:
        assert np.all(measure(skins, model.positions(step.state.x), 1e-3).depth < 0.02 * 0.5)
        found[round(step.state.t, 6)] = -float(step.support_impulse[top].sum(axis=0)[1])
    return found


def test_steps_of_three_facets_end_where_short_ones_end() -> None:
    """It slides by three facets of the bed: parts of the way are gone, or the step is cut. Without friction the state has no history."""
    short, long = vertical(drawn(0.5, 12, h=0.25)), vertical(drawn(0.5, 3))
    assert_allclose(long[3.0], short[3.0], rtol=1e-6)


def test_a_step_that_may_not_be_cut_says_what_it_loses() -> None:
    with pytest.raises(NotConverged, match=r"step 3 did not converge .*contacts are lost on the way: 'punch' lies 0\.\d+ m deep in 'bed'"):
        vertical(drawn(1.6, 3, cuttings=0))


def test_sliding_off_an_edge_and_lifting_off_lose_nothing() -> None:
    """The punch leaves the bed over its end in steps of 0.4: its contacts go, and no step is cut for that."""
    steps = list(drawn(0.4, 6, start=3.0))
    assert len(steps[3].contacts) > 0 == len(steps[-1].contacts)
    assert all(attempt.solver != "contacts" for step in steps for attempt in step.attempts)


def test_of_linear_bodies() -> None:
    """Their contacts are those of the step's beginning, so that a long step carries the punch through the ridge beside it."""
    with pytest.raises(NotConverged, match="contacts are lost on the way: 'punch' lies"):
        vertical(drawn(0.5, 3, cuttings=0, linear=True))
