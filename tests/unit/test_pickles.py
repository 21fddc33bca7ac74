"""Models and simulations go to other processes as what they are made of."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from fcsim import Body, Everything, ExactContacts, Material, Simulation, Support, Theta, build_model, solve
from fcsim.contact_law import Rolling
from fcsim.errors import InputError
from fcsim.mesh import brick, rigid_box, rigid_plane, rigid_sphere
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.energies import neo_hooke
from fcsim.problem.rolling import GlobalRollingProblem, RollingReduction


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
    with pytest.raises(TypeError, match=r"^a Reduction holds factors .*, as problem, local$"):
        pickle.dumps(step.reduction)
    assert np.array_equal(pickle.loads(pickle.dumps(step.state)).x, step.state.x)
    local = step.reduction.local
    for other in (pickle.loads(pickle.dumps(local)), copy.deepcopy(local)):
        again = solve(other, "auto", tol=1e-10)
        assert again.solved and np.allclose(again.r, solve(local, "auto", tol=1e-10).r, rtol=0, atol=1e-12)


def test_a_state_leaves_its_model_here() -> None:
    """What a state keeps for its steps holds the model, whose gravity may be a function that no other process can name."""
    block = rigid_box("block", (0.2, 0.1, 0.1), (0.0, 0.0, 0.0), 1.0)
    model = build_model([block], gravity=lambda t: (0.0, 0.0, -9.81))
    *_, step = Simulation(model, Everything(model, mu=0.1), Theta(1e-3), 2)
    for state in (step.previous, step.state):
        assert np.array_equal(pickle.loads(pickle.dumps(state)).x, state.x)


def test_a_problem_with_rolling_resistance_names_its_local_form() -> None:
    plane, ball = rigid_plane("floor", (0, 0, 0), (0, 0, 1), size=1.0), rigid_sphere("ball", 0.1, (0.0, 0.0, 0.1), 1.0)
    model = build_model([plane, ball], supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz"))], gravity=gravity)
    [step] = Simulation(model, ExactContacts(model, 0.5), Theta(1e-3, law=Rolling(0.01)), 1)
    with pytest.raises(InputError, match=r"expected 2 or 3, got 5 unknowns a contact: with rolling resistance take .*RollingReduction$"):
        _ = step.reduction.local
    assert isinstance(step.problem, GlobalRollingProblem)
    local = RollingReduction(step.problem, step.reduction).local
    assert np.array_equal(pickle.loads(pickle.dumps(local)).q, local.q)
    assert pickle.loads(pickle.dumps(step.result)).error == step.result.error
