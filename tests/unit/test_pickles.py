"""Models and simulations go to other processes as what they are made of."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from fcsim import Body, Everything, Material, Simulation, Support, Theta, build_model
from fcsim.mesh import brick, rigid_box
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.energies import neo_hooke


def gravity(t: float) -> tuple[float, ...]:
    return (2.0, 0.0, -9.81)


def sliding(material: Any) -> Simulation:
    block = brick("block", (0.2, 0.1, 0.1), (2, 1, 1), material)
    bodies = [rigid_box("floor", (1.0, 0.4, 0.1), (0.1, 0.05, -0.05), 1.0), Body("block", block)]
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz"))], gravity=gravity, beta=1e-3)
    return Simulation(model, Everything(model, mu=0.1), Theta(1e-3), 3)


@pytest.mark.parametrize("material", [Material(2e8, 0.2, 2000.0), neo_hooke(2e8, 0.3, 2000.0)], ids=["linear", "rubber"])
def test_a_simulation_goes_on_elsewhere_to_the_same_bits(material: Any) -> None:
    """Also one that has run: its factors stay here. What comes back is read-only as before."""
    simulation = sliding(material)
    expected = list(simulation)[-1].state.x
    for other in (pickle.loads(pickle.dumps(simulation)), copy.deepcopy(simulation)):
        assert other.model is not simulation.model and other.detector is not simulation.detector
        assert np.array_equal(list(other)[-1].state.x, expected)
        part = next(body.part for body in other.model.bodies if isinstance(body, Body))
        assert not part.points.flags.writeable and not part.surfaces["z-"].flags.writeable
        with pytest.raises(TypeError):
            part.surfaces["z-"] = None


def test_materials_by_region() -> None:
    given = ByRegion({"a": Material(2e8, 0.2, 2000.0)})
    assert dict(pickle.loads(pickle.dumps(given)).materials) == dict(given.materials)


def test_a_step_says_that_it_stays() -> None:
    *_, step = sliding(Material(2e8, 0.2, 2000.0))
    with pytest.raises(TypeError, match=r"^a Step holds factors and matrices of its process.* take what is needed of it, as state"):
        pickle.dumps(step)
    assert np.array_equal(pickle.loads(pickle.dumps(step.state)).x, step.state.x)
    assert pickle.loads(pickle.dumps(step.result)).error == step.result.error
