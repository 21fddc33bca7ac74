"""The simulation: warm start, fallback chain, the two ways of driving, what a step reports."""

import dataclasses
import gc
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Contacts, Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Velocity
from fcsim.errors import InputError, NotConverged
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.solvers import SOLVERS, Status
from fcsim.solvers.base import Iterate
from fcsim.timestep.chain import LEADS, LEARNED, NOBODY, Lead, SolverSettings
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.step import Moment
from fcsim.timestep.theta import Theta

SOFT = Material(1e7, 0.2, 2000.0)


def contacts_of(identity: list[int], frame: np.ndarray) -> Contacts:
    nc = len(identity)
    d = frame.shape[-1]
    empty = np.zeros((nc, 1))
    return Contacts(
        np.zeros((nc, d)), frame, np.zeros(nc), np.full(nc, 0.5), empty.astype(int), empty, np.zeros((nc, 2), int), np.array(identity)
    )


def frames(count: int, seed: int, d: int = 3) -> np.ndarray:
    rotations = Rotation.random(count, rng=np.random.default_rng(seed)).as_matrix()
    if d == 3:
        return rotations
    angle = np.random.default_rng(seed).uniform(0, 6, count)
    return np.stack([np.stack([np.cos(angle), np.sin(angle)], 1), np.stack([-np.sin(angle), np.cos(angle)], 1)], 1)


@pytest.mark.parametrize("d", [2, 3])
def test_reactions_keep_their_vector_in_space(d: int) -> None:
    """Contacts 3 and 40 go, 7 and 100 come, the frames of all others turn."""
    old = [1, 3, 12, 40, 55]
    new = [1, 7, 12, 55, 100]
    r = np.random.default_rng(0).standard_normal((5, d))
    old_frame, new_frame = frames(5, 1, d), frames(5, 2, d)
    start = Reactions(np.array(old), old_frame, r).transfer(contacts_of(new, new_frame)).reshape(-1, d)
    for k, identity in enumerate(new):
        in_space = new_frame[k].T @ start[k]
        expected = old_frame[old.index(identity)].T @ r[old.index(identity)] if identity in old else np.zeros(d)
        assert_allclose(in_space, expected, atol=1e-14)


def test_reactions_of_none_and_for_none() -> None:
    assert Reactions(np.array([1]), frames(1, 0), np.ones((1, 3))).transfer(contacts_of([], frames(0, 0).reshape(0, 3, 3))).shape == (0,)


def press(
    driven: str = "eliminated", law: Any = None, settings: SolverSettings | None = None, steps: int = 6, **options: Any
) -> Simulation:
    """A block held at its side on a block held at its base, pushed down and aside by a driven rigid plate."""
    part = brick("block", (0.2, 0.2, 0.1), (2, 2, 1), SOFT)
    small = brick("small", (0.1, 0.1, 0.1), (2, 2, 1), SOFT)
    upper = Body("upper", small, translation=np.array([0.043, 0.057, 0.1]))
    plate = rigid_box("plate", (0.3, 0.3, 0.1), (0.1, 0.1, 0.25 + 1e-5), 5.0)
    model = build_model(
        [Body("lower", part), upper, plate],
        supports=[
            Support("lower", ("x", "y", "z"), "z-"),
            Support("plate", ("z",), velocity=-0.02),
            Support("plate", ("x",), velocity=lambda t: 0.3 * t),
            Support("plate", ("y", "rx", "ry", "rz")),
        ],
        gravity=lambda t: (0, 0, -9.81),
        beta=1e-3,
        driven=driven,  # type: ignore[arg-type]
        **options,
    )
    pairs = [
        SurfacePair(contact_surface(model, [("upper", "z-")]), contact_surface(model, [("lower", "z+")]), 0.4, 1e-3),
        SurfacePair(contact_surface(model, [("upper", "z+")]), contact_surface(model, [("plate", "z-")]), 0.6, 1e-3),
    ]
    scheme = Theta(1e-3) if law is None else Theta(1e-3, law=law)
    return Simulation(model, Detector(pairs, model.n_nodes), scheme, steps, settings or SolverSettings())


@pytest.mark.parametrize("lumped", [True, False])
def test_eliminated_and_identity_are_the_same_problem(lumped: bool) -> None:
    """Same W, q, r, v, reactions at the supports; n differs by the driven dofs."""
    runs = [list(press(driven, lumped=lumped)) for driven in ("eliminated", "identity")]
    model = press().model
    for one, other in zip(*runs, strict=True):
        assert one.problem.n == len(model.free_dofs) and other.problem.n == model.n_dofs
        W, W2 = one.reduction.local.W, other.reduction.local.W
        assert_allclose(W, W2, atol=1e-11 * np.abs(W).max())
        assert_allclose(one.reduction.q, other.reduction.q, atol=1e-9 * max(np.abs(one.reduction.q).max(), 1e-3))
        assert_allclose(one.result.r, other.result.r, atol=1e-7 * np.abs(one.result.r).max(initial=1e-6))
        assert_allclose(one.state.v, other.state.v, atol=1e-9)
        assert_allclose(one.support_impulse, other.support_impulse, atol=1e-6 * np.abs(one.support_impulse).max())
        for step in (one, other):  # u = H^T v over all dofs is what the solver saw
            u = step.H.T @ step.state.v
            u[:: step.contacts.dimension] += step.contacts.gap / 1e-3
            assert_allclose(u, step.result.u, atol=1e-12)
    assert runs[0][-1].contact_status.any()


@pytest.mark.parametrize("law", [None, Velocity(0.5)])
def test_the_problem_of_a_step_is_the_whole_model(law: Any) -> None:
    """M v = H r + f solved with dense algebra from the exported problem alone gives the step's v."""
    for step in press("identity", law):
        p = step.problem
        v = np.linalg.solve(p.M.toarray(), p.H @ step.result.r + p.f)
        assert_allclose(v, step.state.v, atol=1e-10)


@pytest.mark.parametrize("driven", ["eliminated", "identity"])
def test_the_problem_of_a_step_with_a_tumbling_body(driven: str) -> None:
    """A long block falls on its corner on an elastic one and tumbles: each step's exported M holds the inertia of its orientation, and
    with dense algebra M v = H r + f has the solution of the step; the state has its angular momentum, up to the moments outside."""
    part = brick("base", (0.2, 0.2, 0.1), (2, 2, 1), SOFT)
    block = rigid_box("block", (0.1, 0.02, 0.04), (0.1, 0.1, 0.18), 0.3)
    supports = [Support("base", ("x", "y", "z"), "z-")]
    model = build_model([Body("base", part), block], supports=supports, gravity=lambda t: (0, 0, -9.81), driven=driven)  # type: ignore[arg-type]
    pair = SurfacePair(
        contact_surface(model, [("block", side) for side in ("x-", "x+", "z-", "z+")]), contact_surface(model, [("base", "z+")]), 0.4, 1e-2
    )
    initial = at_rest(model)
    initial.v[-6:] = [0.1, 0, -1.0, 3.0, 9.0, 5.0]
    simulation = Simulation(model, Detector([pair], model.n_nodes), Theta(2e-3), 40, SolverSettings(name="auto", tol=1e-10), initial)
    blocks, steps = [], list(simulation)
    for step in steps:
        p = step.problem
        M = p.M.toarray()
        v = np.linalg.solve(M, p.H @ step.result.r + p.f)
        assert_allclose(v, step.result.v, atol=1e-9)
        before = model.apply_mass(step.previous.v, model.rigid_mass(step.previous.x))[-3:]
        after = model.apply_mass(step.state.v, model.rigid_mass(step.state.x))[-3:]
        assert_allclose(after - before, (step.H @ step.result.r)[-3:], atol=1e-12)
        blocks.append(M[-3:, -3:])
        assert_allclose(np.linalg.eigvalsh(blocks[-1]), np.sort(np.diag(block.inertia)), rtol=1e-10)
    assert any(np.any(step.result.r) for step in steps)
    assert np.abs(blocks[-1] - blocks[0]).max() > 0.1 * np.abs(blocks[0]).max()
    again = list(simulation.run(steps[29].moment, steps[29].anchor))[-1]
    assert_array_equal(again.state.x, steps[-1].state.x)
    assert_array_equal(again.state.v, steps[-1].state.v)


def test_a_step_is_a_function_of_its_state() -> None:
    """Continuing from a stored moment and its anchor gives the same bits."""
    whole = list(press())
    again = list(press().run(whole[2].moment, whole[2].anchor))
    assert [step.number for step in again] == [4, 5, 6]
    for one, other in zip(whole[3:], again, strict=True):
        assert_array_equal(one.state.x, other.state.x)
        assert_array_equal(one.state.v, other.state.v)
        assert_array_equal(one.result.r, other.result.r)


def test_a_script_cannot_write_into_what_the_next_step_is_made_of() -> None:
    """The pattern of H is that of the steps to come: a script that changed it changed these, on one rank those of all."""
    for step in press(steps=2):
        assert step.H.nnz and abs(step.H - step.encounter.H).max() == 0
        for values in (step.H.data, step.H.indices, step.H.indptr):
            with pytest.raises(ValueError, match="read-only"):
                values[0] = 7


def test_a_script_that_writes_into_a_steps_state_does_not_change_the_steps_to_come() -> None:
    """Metres become millimetres in place."""
    for one, other in zip(press(steps=3), press(steps=3), strict=True):
        assert_array_equal(one.state.x, other.state.x)
        assert_array_equal(one.state.v, other.state.v)
        for values in (one.state.x, one.state.v):
            values *= 1e3


def test_steps_leave_nothing_to_the_collector_of_cycles() -> None:
    """A step that is in a circle of references stays until Python looks for circles, which it does ever less often in a long run."""
    steps = iter(press(steps=12))
    for _ in range(4):  # the first ones make what is kept
        next(steps)
    gc.collect()
    gc.set_debug(gc.DEBUG_SAVEALL)
    gc.disable()
    try:
        for _ in range(4):
            next(steps)
        gc.collect()
        left = [type(value).__name__ for value in gc.garbage if type(value).__module__.startswith(("fcsim", "scipy"))]
    finally:
        gc.enable()
        gc.set_debug(0)
        gc.garbage.clear()
    assert not left


def test_warm_start_takes_fewer_iterations() -> None:
    steps = list(press(steps=12))
    simulation = press(steps=12)
    cold = [simulation.step(Moment(s.number - 1, s.previous)).iterations for s in steps]
    warm = [s.iterations for s in steps]
    assert sum(warm) < sum(cold)


@pytest.fixture
def broken_solver(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A solver that hands back zero and says it stagnated."""
    method = dataclasses.replace(
        SOLVERS["NSN-AC"],
        run=lambda problem, r, monitor, options: Iterate(np.zeros_like(r), Status.STAGNATED),
        run_global=None,
        run_followed=None,
    )
    monkeypatch.setitem(SOLVERS, "BROKEN", method)
    yield "BROKEN"


def test_fallback_chain_is_walked_and_reported(broken_solver: str) -> None:
    settings = SolverSettings(name=broken_solver, fallback=(broken_solver, "NSN-NM", "NSGS-AC"))
    steps, reference = list(press(settings=settings)), list(press())
    last = steps[-1]
    walked = next(step for step in steps if len(step.attempts) > 2 and step.attempts[1].solver == "BROKEN")
    chain = [("BROKEN", "previous steps"), ("BROKEN", "zero"), ("NSN-NM", "zero")]
    assert [(a.solver, a.start) for a in walked.attempts[:3]] == chain
    assert [a.status for a in walked.attempts[:3]] == ["stagnated", "stagnated", "solved"]
    assert walked.attempts[0].error > 1e-8 >= walked.attempts[-1].error
    assert last.result.method == "NSN-NM" and last.result.solved
    assert_allclose(last.state.v, reference[-1].state.v, atol=1e-7)


def test_chain_of_a_method_stopped_by_its_options() -> None:
    steps = list(press(settings=SolverSettings(name="NSN-AC", options={"max_iterations": 0}, fallback=("NSN-AC-HYBRID",))))
    walked = [step for step in steps if len(step.contacts) and step.attempts[0].solver == "NSN-AC" and len(step.attempts) > 1]
    assert all(step.attempts[0].status == Status.MAX_ITERATIONS.value for step in walked)
    assert {step.attempts[-1].solver for step in walked} == {"NSN-AC-HYBRID"}
    assert all(step.result.solved for step in steps)


def test_a_chain_learns_which_link_answers() -> None:
    """After three steps in which a later link had to answer, it begins; the reference is the walk itself, 25 steps long."""
    steps = list(press(settings=SolverSettings(name="NSN-AC", options={"max_iterations": 0}, fallback=("NSN-AC-HYBRID",))))
    firsts = [step.attempts[0] for step in steps if np.any(step.start) or len(step.attempts) > 1]
    begun = [a.solver for a in firsts]
    learned = begun.index("NSN-AC-HYBRID")
    assert begun[:learned] == ["NSN-AC"] * learned and firsts[learned].leads and not firsts[0].leads
    assert sum(len(step.attempts) > 1 for step in steps[: steps.index(next(s for s in steps if s.attempts[0] is firsts[learned]))]) >= 3


def test_who_leads() -> None:
    lead = NOBODY
    for _ in range(LEARNED):
        assert not lead.steps
        lead = lead.after("first", "second")
    assert (lead.solver, lead.steps) == ("second", LEADS)
    for left in range(LEADS - 1, 0, -1):
        lead = lead.after("second", "second")
        assert lead.steps == left
    assert lead.after("second", "second") == NOBODY  # then the first has its chance again
    assert Lead("second", 3, 5).after("second", "third") == NOBODY
    assert Lead("second", 2).after("first", "third") == Lead("third", 1)
    assert Lead("second", 2).after("first", "first") == NOBODY


def test_no_step_goes_on_unconverged(broken_solver: str) -> None:
    simulation = press(settings=SolverSettings(name=broken_solver, fallback=()))
    done = []
    with pytest.raises(NotConverged, match=r"step \d+ did not converge to 1e-08 \(BROKEN from previous steps: stagnated, error .*\)"):
        for step in simulation:
            done.append(step)
    assert all(step.result.solved for step in done)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "NSN-XX"}, "expected one of auto, NSN-AC"),
        ({"fallback": ("NSN-XX",)}, "expected one of auto, NSN-AC"),
        ({"tol": 0.0}, "tol"),
        ({"tol": float("nan")}, "tol"),
        ({"floor": -1.0}, "floor"),
        ({"options": {"iterations": 3}}, "expected one of .*max_iterations"),
    ],
)
def test_settings_are_checked_before_a_run(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SolverSettings(**options)


def test_negative_number_of_steps() -> None:
    with pytest.raises(InputError, match="steps"):
        press(steps=-1)
    assert list(press(steps=0)) == []


def test_forces_on_bodies_come_from_the_reactions() -> None:
    """contact_force_on against the nodal impulses H r, body by body; action = reaction."""
    simulation = press()
    model: Model = simulation.model
    step = list(simulation)[-1]
    nodal = step.H @ step.result.r / 1e-3
    total = np.zeros(3)
    for number in range(len(model.bodies)):
        own = nodal[model.dof_offset[number] : model.dof_offset[number + 1]]
        force = own.reshape(-1, 3).sum(axis=0) if number < 2 else own[:3]
        assert_allclose(step.contact_force_on(number), force, atol=1e-9 * np.abs(nodal).max())
        total += force
    assert np.abs(nodal).max() > 1
    assert_allclose(total, 0, atol=1e-9 * np.abs(nodal).max())
    for number, body in enumerate(model.bodies):  # a name was taken for a number that no contact has: the force was zero
        assert_array_equal(step.contact_force_on(body.name), step.contact_force_on(number))


def test_rigid_motion_of_everything_moves_no_contact() -> None:
    """A common translation gives u = 0, whatever the contacts."""
    simulation = press()
    step = list(simulation)[-1]
    model = simulation.model
    v = np.zeros(model.n_dofs)
    for k, c in enumerate((3.0, -2.0, 5.0)):
        v[k : model.n_elastic : 3] = c
        v[model.n_elastic + k] = c
    assert_allclose(step.H.T @ v, 0, atol=1e-13)
