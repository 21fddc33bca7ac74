"""Pairs that find nothing are named, and what falls through is ended by the witness."""

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.never_touching import never_touching
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_detection.surfaces.surface import CandidateRule
from fcsim.errors import Penetration
from fcsim.mesh.blocks import rigid_box, rigid_rectangle
from fcsim.timestep.simulation import Simulation, SolverSettings
from fcsim.timestep.theta import Theta


def falling(slave: tuple[str, str], master: tuple[str, str], unit: float, d: int = 3) -> Simulation:
    if d == 3:
        bodies = [
            rigid_box("floor", (2 * unit, 2 * unit, 0.2 * unit), (0, 0, -0.1 * unit), 1.0),
            rigid_box("cube", (unit, unit, unit), (0, 0, 0.501 * unit), 1.0),
        ]
        held, gravity = ("x", "y", "z", "rx", "ry", "rz"), (0, 0, -9.81 * unit)
    else:
        bodies = [rigid_rectangle("floor", (2 * unit, 0.2 * unit), (0, -0.1 * unit), 1.0)]
        bodies.append(rigid_rectangle("cube", (unit, unit), (0, 0.501 * unit), 1.0))
        held, gravity = ("x", "y", "rz"), (0, -9.81 * unit)
    model = build_model(bodies, supports=[Support("floor", held)], gravity=lambda t: gravity)
    pair = SurfacePair(*(contact_surface(model, [part]) for part in (slave, master)), 0.5, 1e-3 * unit)
    return Simulation(model, Detector([pair], model.n_nodes), Theta(1e-2), 30, SolverSettings(name="auto"))


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(
    ("slave", "master", "why"),
    [
        (("cube", "z+"), ("floor", "z+"), "look the same way"),
        (("cube", "x-"), ("floor", "z+"), "look the same way"),
        (("cube", "z+"), ("floor", "z-"), "behind the master"),
        (("floor", "z+"), ("cube", "z-"), "swap the two"),
    ],
)
def test_what_finds_nothing_is_named_and_ended(slave, master, why: str, unit: float) -> None:
    run, remarks = iter(falling(slave, master, unit)), []
    with pytest.raises(Penetration, match=r"'cube'"):
        for step in run:
            remarks += step.remarks
    assert len([remark for remark in remarks if why in remark and "'cube'" in remark and "'floor'" in remark]) == 1


@pytest.mark.parametrize("d", [2, 3])
def test_what_is_right_is_not_remarked(d: int) -> None:
    side = ("z-", "z+") if d == 3 else ("y-", "y+")
    steps = list(falling(("cube", side[0]), ("floor", side[1]), 1.0, d))
    assert not any(step.remarks for step in steps)
    assert steps[-1].penetration < 1e-9


@pytest.mark.parametrize("rule", ["nodes", "faces", "gauss"])
@pytest.mark.parametrize("over", [True, False])
def test_a_facet_larger_than_the_master_may_have_a_candidate_over_it(rule: CandidateRule, over: bool) -> None:
    """A table of 2 x 2 m, its top one facet, and a stone of 0.2 m on the candidate: a corner, the centre, a Gauss point."""
    place = {"nodes": (1.0, 1.0), "faces": (0.0, 0.0), "gauss": (3**-0.5, 3**-0.5)}[rule]
    x, y = place if over else (0.5 * place[0] + 0.3, 0.3 * place[1])  # elsewhere on the table
    bodies = [rigid_box("table", (2, 2, 0.2), (0, 0, -0.1), 1.0), rigid_box("stone", (0.2, 0.2, 0.2), (x, y, 0.1), 1.0)]
    model = build_model(bodies, supports=[Support("table", ("x", "y", "z", "rx", "ry", "rz"))])
    slave, master = (contact_surface(model, [part]) for part in (("table", "z+"), ("stone", "z-")))
    detector = Detector([SurfacePair(slave, master, 0.5, 1e-3, rule)], model.n_nodes)
    positions = model.positions(np.zeros(model.n_dofs))
    said = never_touching(detector.pairs, positions, [body.name for body in model.bodies])
    assert (len(detector(positions)) > 0) == over
    assert [("larger than the master" in text) for text in said] == ([] if over else [True])
