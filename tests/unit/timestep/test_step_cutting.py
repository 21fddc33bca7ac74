"""Steps that do not converge are halved; they end on the grid, and go on longer when they can.

Newton's method with few iterations fails on a load step by its nature: the more the contact status changes, the more it needs.
"""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError, NotConverged, Unphysical
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.solvers import Result, Status
from fcsim.timestep import chain
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta


def pressed(scheme: Scheme, steps: int, iterations: int, cuttings: int = 6, drag: float = 0.02, **options: Any) -> Simulation:
    """A soft block pressed on a rigid plane at 1 cm/s, from t = 0.5 s on dragged along at `drag` [m/s]."""
    part = brick("block", (1.0, 0.4, 0.3), (4, 3, 2), Material(1e6, 0.3, 1000.0))
    model = build_model(
        [Body("block", part), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)],
        supports=[
            Support("plane", ("x", "y", "z", "rx", "ry", "rz")),
            Support("block", ("z",), "z+", velocity=-0.01),
            Support("block", ("x",), "z+", velocity=lambda t: drag * (t > 0.5)),
            Support("block", ("y",), "z+"),
        ],
        beta=1e-3,
    )
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("plane", "z+")]), 0.5, 1e-1)
    settings = SolverSettings(name="NSN-AC", options={"max_iterations": iterations}, fallback=(), **options)
    return Simulation(model, Detector([pair], model.n_nodes), scheme, steps, settings, cuttings=cuttings)


def test_a_step_that_is_too_long_is_cut() -> None:
    """And gives what as many short steps give: equal x, r, v on the grid; sums of energy and iterations over the parts."""
    simulation = pressed(QuasiStatic(0.5), 2, iterations=3)
    first, second = list(simulation)
    assert (first.substeps, first.attempts[0].share) == (1, 1.0)
    assert second.substeps > 1 and second.attempts[0].share == 1.0
    failed = [a.share for a in second.attempts if a.status != "solved"]
    solved = [a.share for a in second.attempts if a.status == "solved"]
    assert max(solved) < 1.0 == max(failed) and sum(solved) == 1.0 and len(solved) == second.substeps
    assert [step.state.t for step in (first, second)] == [0.5, 1.0]
    assert second.result.solved and second.result.error <= 1e-8

    moment = first.moment
    parts: list[Step] = []
    for share in solved:
        alone = pressed(QuasiStatic(0.5 * share), 9, iterations=200)
        parts.append(alone.step(moment))
        moment = parts[-1].moment
    assert_allclose(second.state.x, parts[-1].state.x, atol=1e-8 * np.abs(second.state.x).max())
    assert_allclose(second.contact_force, parts[-1].contact_force, atol=1e-6 * np.abs(second.contact_force).max())
    assert second.iterations >= second.substeps
    for term in ("load_work", "support_work", "tangential_dissipation", "friction_dissipation", "numerical_dissipation"):
        total = sum(getattr(part.energy, term) for part in parts)
        assert_allclose(getattr(second.energy, term), total, rtol=1e-6, atol=1e-9, err_msg=term)
    assert_allclose(second.energy.elastic, parts[-1].energy.elastic, rtol=1e-8)
    assert abs(second.energy.residual) < 1e-12 * abs(second.energy.support_work)


def test_parts_are_doubled_again_when_it_goes_well() -> None:
    """Only the step in which sliding begins is hard."""
    steps = list(pressed(QuasiStatic(0.25), 8, iterations=3))
    assert [step.substeps for step in steps[:2]] == [1, 1]
    assert max(step.substeps for step in steps) > 1
    assert steps[-1].substeps == 1 and steps[-1].cuts == 0
    assert_array_equal([step.state.t for step in steps], 0.25 * np.arange(1, 9))


def test_a_step_that_is_given_up_is_cut_once_and_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """No further link is asked, no shorter part than a half is tried: the end comes after a bounded time."""
    solve, asked = chain.solve, []

    def creeping(*arguments: Any, **options: Any) -> Result:
        asked.append(arguments[1])
        return replace(solve(*arguments, **options), status=Status.EXHAUSTED)

    monkeypatch.setattr(chain, "solve", creeping)
    simulation = pressed(QuasiStatic(0.5), 2, iterations=3)
    with pytest.raises(NotConverged, match=r"cut into parts of h/2 to h/2 = 0\.25 s.*give the joints stiffness"):
        next(iter(replace(simulation, solver=replace(simulation.solver, fallback=("NSN-NM",)))))
    assert asked == ["NSN-AC", "NSN-AC"]


def test_what_was_tried_is_said_when_cutting_does_not_help() -> None:
    done = []
    with pytest.raises(NotConverged) as caught:
        for step in pressed(QuasiStatic(0.5), 2, iterations=0, cuttings=3):
            done.append(step)
    text = str(caught.value)
    assert not done
    assert "step 1 did not converge to 1e-08 (NSN-AC from previous steps: maximum number of iterations reached, error " in text
    assert "from t = 0 to 0.5 s: cut into parts of h/2 to h/8 = 0.0625 s, the last from t = 0 s" in text
    with pytest.raises(NotConverged) as caught:
        list(pressed(QuasiStatic(0.5), 2, iterations=3, cuttings=0))
    assert "cut into" not in str(caught.value) and "step 2" in str(caught.value)


def test_a_later_part_that_fails_names_its_time() -> None:
    with pytest.raises(NotConverged, match=r"step 2 .* from t = 0.5 to 1 s: .* h/2 to h/2 = 0\.25 s, the last from t = "):
        list(pressed(QuasiStatic(0.5), 2, iterations=3, cuttings=1))


def test_dynamics_is_cut_too() -> None:
    """Impulses of parts and of whole steps differ by their length: the warm start takes that into account."""
    h = 0.1
    whole = list(pressed(Theta(h), 10, iterations=200, drag=0.04))
    cut = list(pressed(Theta(h), 10, iterations=3, drag=0.04))
    assert max(step.substeps for step in cut) > 2
    for step in cut:
        assert step.force_per_reaction == pytest.approx(1 / step.scheme.h)
        assert_allclose(step.state.t, h * step.number, rtol=1e-14)
        assert_allclose(step.reactions.r, step.contact_force * h)
        assert abs(step.energy.residual) < 1e-11 * abs(step.energy.support_work)
    force, expected = (np.array([step.force_in_space.sum(axis=0) for step in steps]) for steps in (cut, whole))
    assert_allclose(force, expected, atol=0.05 * np.abs(expected).max())


def test_going_on_after_a_cut_step_is_bit_by_bit_the_same() -> None:
    whole = list(pressed(QuasiStatic(0.25), 8, iterations=2))
    at = next(k for k, step in enumerate(whole) if step.cuts)
    again = list(pressed(QuasiStatic(0.25), 8, iterations=2).run(whole[at].moment, whole[at].anchor))
    for one, other in zip(whole[at + 1 :], again, strict=True):
        assert (one.substeps, one.cuts) == (other.substeps, other.cuts)
        assert_array_equal(one.state.x, other.state.x)
        assert_array_equal(one.result.r, other.result.r)


@pytest.mark.parametrize("cuttings", [-1, 21])
def test_refusals(cuttings: int) -> None:
    with pytest.raises(InputError, match="cuttings"):
        pressed(QuasiStatic(0.5), 2, 4, cuttings)


def cube_under(gravity: float, tol: float, scheme: Scheme) -> Simulation:
    model = build_model(
        [rigid_box("cube", (1, 1, 1), (0, 0, 0.5), 1.0), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)],
        supports=[Support("plane", ("x", "y", "z", "rx", "ry", "rz"))],
        gravity=lambda t: (0.0, 0.0, -gravity),
    )
    return Simulation(model, Everything(model, 0.5), scheme, 2, SolverSettings(tol=tol))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("gravity", [1e20, 1e200])
def test_a_flight_beside_which_round_off_hides_everything(gravity: float) -> None:
    """No tolerance that floats have tells a penetration from such a step's free motion: it is said, not tried for minutes."""
    with pytest.raises(Unphysical, match=r"bodies would move by .* times the model's size, 4 m, in one step.*a shorter step$"):
        list(cube_under(gravity, 1e-8, Theta(1e-2)))


def test_a_tolerance_that_a_flight_leaves_no_numbers_for() -> None:
    """What a sharp tolerance alone refuses is mended by another one: that which the message names is enough, and bears the weight."""
    gravity, scheme = 10.0, QuasiStatic(1.0, eta=1e-4)
    with pytest.raises(Unphysical, match="or a larger tolerance") as refused:
        list(cube_under(gravity, 1e-12, scheme))
    named = re.search(r"larger tolerance, (\S+) instead of 1e-12", str(refused.value))
    assert named is not None
    last = list(cube_under(gravity, float(named[1]), scheme))[-1]
    assert last.contact_force_on("cube")[2] == pytest.approx(gravity, rel=1e-6)
