"""Bodies and contacts in one loop beside the sequence of friction problems: the same answers, and the order of convergence."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.mesh import Body, Material
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import neo_hooke
from fcsim.problem import GlobalProblem, scaled_error
from fcsim.problem.reduction import Reduction, reduced
from fcsim.solvers import Memory, Result, Status, solve
from fcsim.solvers.automatic.pause import Pause
from fcsim.timestep.chain import Attempt, Chain, SolverSettings
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.reactions.expected_motion import expected_motion, with_motion
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.equation import Equation
from fcsim.timestep.step_equation.linearisation import Linearisation
from fcsim.timestep.step_equation.loops.one_loop import FollowedLoad, solve_followed
from fcsim.timestep.theta import Theta

TOL = 1e-10


@cache
def thrown(loop: str, solver: str = "NSN-AC") -> list[Step]:
    """A soft block that slides along the ground and turns over its front corner."""
    ground = rigid_rectangle("ground", (4.0, 0.2), (1.0, -0.1), 1.0)
    part = rectangle("block", (0.1, 0.2), (3, 5), Material(E=1e6, nu=0.2, density=2000.0))
    held = Support("ground", ("x", "y", "rz"))
    model = build_model([Body("block", part), ground], supports=[held], gravity=lambda t: (0.0, -9.81), beta=1e-4, kinematics="turning")
    below, top = contact_surface(model, [("block", "y-"), ("block", "x+")]), contact_surface(model, [("ground", "y+")])
    arm = part.points - (0.05, 0.0)
    v = np.zeros(model.n_dofs)
    v[: model.n_elastic] = np.column_stack([1.0 + 4.0 * arm[:, 1], -4.0 * arm[:, 0]]).ravel()
    detector = Detector([SurfacePair(below, top, 0.5, 0.01)], model.n_nodes)
    settings = SolverSettings(name=solver, tol=TOL, loop=loop)
    start = State(0.0, np.zeros(model.n_dofs), v)
    return list(Simulation(model, detector, Theta(2e-3), 25, settings, initial=start, witness=None))


def test_turning_bodies_in_one_loop_have_the_answer_of_the_sequence() -> None:
    one, sequence = thrown("one"), thrown("sequence")
    last = one[-1]
    assert any(len(step.contacts) and step.result.r.any() for step in one)
    size = np.abs(last.state.x).max()
    assert size > 0.03
    assert_allclose(last.state.x, sequence[-1].state.x, atol=1e-7 * size)
    assert sum(len(step.attempts) for step in one) < sum(len(step.attempts) for step in sequence)  # one solve a step that touches
    for step in one:
        assert step.attempts[-1].solver == "NSN-AC" and not step.fell_back
        if step.problem.nc:  # the exported problem, judged by what is in it alone
            local = reduced(step.problem).local  # type: ignore[arg-type]
            assert scaled_error(local, step.result.r) < 1.1 * TOL
    model, before = one[0].model, one[0].previous
    work = 0.5 * float(before.v @ model.apply_mass(before.v))
    assert all(abs(step.energy.residual) < 1e-7 * work for step in one)


def test_matrix_of_a_turning_step_is_made_for_who_reads_it() -> None:
    """And is that of the step, after later ones too: with it M v = H r + f holds to the error that was stated without it."""
    steps = thrown("one", "NSN-FB")  # nobody has read theirs
    assert all("M" not in vars(step.problem) for step in steps)
    for step in (steps[0], steps[len(steps) // 2], steps[-1]):
        p = step.problem
        assert isinstance(p, GlobalProblem) and step.result.v is not None
        residual = p.M @ step.result.v - p.H @ step.result.r - p.f
        assert np.linalg.norm(residual) <= 1e-12 * np.linalg.norm(p.f)
        assert_allclose(p.momentum(step.result.v), p.M @ step.result.v, rtol=1e-11, atol=1e-12 * np.linalg.norm(p.f))
        assert_allclose(p.M.toarray(), p.M.toarray().T, rtol=0, atol=1e-12 * abs(p.M).max())


def test_auto_goes_by_one_loop_where_it_begins_with_newton() -> None:
    """From a warm start; from a cold one it sweeps, by the sequence, and what it does not begin with is no attempt."""
    one, sequence = thrown("auto", "auto"), thrown("sequence", "auto")
    assert_allclose(one[-1].state.x, sequence[-1].state.x, atol=1e-7 * np.abs(one[-1].state.x).max())
    warm = [(a, b) for a, b in zip(one, sequence, strict=True) if np.any(a.start) and a.result.r.any()]
    assert warm and all(len(a.attempts) == 1 for a, _ in warm)
    assert sum(len(b.attempts) for _, b in warm) > 1.5 * len(warm)
    assert all(attempt.status == "solved" for step in one for attempt in step.attempts)


class Bending:
    """A problem whose q moves with r: q = q0 - K r for a small K, so that its answer is that of W - K."""

    def __init__(self, reduction: Reduction, K: FloatArray) -> None:
        self._reduction, self._K = reduction, K
        self.q, self.mu, self.dimension = reduction.q, reduction.mu, reduction.dimension
        self.compliance, self.local = reduction.compliance, reduction.local
        self.asked = 0

    def free(self, r: FloatArray) -> FloatArray:
        self.asked += 1
        return self.q - self._K @ r

    def answer(self, r: FloatArray):  # type: ignore[no-untyped-def]
        answer = self._reduction.answer(r)
        return replace(answer, u=answer.u - self._K @ r)


def touching() -> Reduction:
    step = next(step for step in thrown("sequence") if step.problem.nc > 1 and np.count_nonzero(step.result.r) > 2)
    return reduced(step.problem)  # type: ignore[arg-type, return-value]


@pytest.mark.parametrize(("solver", "on_the_way"), [("NSN-AC", False), ("NSN-FB", True)])
def test_newton_follows_a_problem_whose_q_follows_its_solution(solver: str, on_the_way: bool) -> None:
    """Where its iterates come near the answer by degrees q is linearised anew on the way; where one of them is there, at its end."""
    reduction = touching()
    W = reduction.local.delassus.W
    W = W if isinstance(W, np.ndarray) else W.toarray()
    K = 1e-3 * W
    moving = Bending(reduction, K)
    found = solve(moving, solver, tol=1e-11)
    exact = solve(replace(reduction.local, W=W - K), "NSN-AC", tol=1e-12)
    assert found.solved and exact.solved and bool(moving.asked) is on_the_way
    assert_allclose(found.r, exact.r, atol=1e-8 * np.abs(exact.r).max())
    still = solve(reduction.local, "NSN-AC", tol=1e-12)
    assert np.abs(still.r - exact.r).max() > 1e-5 * np.abs(exact.r).max()
    with pytest.raises(InputError, match="nonsmooth Newton"):
        solve(moving, "NSGS-AC")


class Jumping(Bending):
    """A problem whose q is another one each time that it is looked at: it has no answer."""

    def free(self, r: FloatArray) -> FloatArray:
        self.asked += 1
        return self.q * (1 + 0.5 * (-1) ** self.asked)

    def answer(self, r: FloatArray):  # type: ignore[no-untyped-def]
        answer = self._reduction.answer(r)
        return replace(answer, u=answer.u + self.free(r) - self.q)


def test_auto_pauses_after_newton_has_failed() -> None:
    """Not tried on the next problem, then on the next four, and no more pauses once it has an answer."""
    problem = touching()
    start = 1.01 * solve(problem, "NSN-AC", tol=TOL).r
    memory = Memory.of(np.arange(len(problem.mu)))
    still = np.zeros((len(start), len(start)))

    def tried(of: Bending) -> bool:
        nonlocal memory
        result = solve(of, "auto", start, tol=TOL, memory=memory)
        assert result.memory is not None
        memory = result.memory
        return result.iterations > 0

    assert [tried(Jumping(problem, still)) for _ in range(8)] == [True, False, True, *[False] * 4, True]
    assert [tried(Bending(problem, still)) for _ in range(18)] == [False] * 16 + [True] * 2
    assert memory.earlier(Pause) is None


def pressed(loop: str, mu: float, **rule: Any) -> list[Step]:
    """A rubber punch that is pressed into a softer bed and drawn along it, in statics."""
    bed, punch = (
        rectangle("bed", (4.0, 1.0), (4, 2), neo_hooke(1e6, 0.3, 1.0)),
        rectangle("punch", (0.5, 0.5), (3, 3), neo_hooke(3e6, 0.3, 1.0)),
    )
    supports = [
        Support("bed", ("x", "y"), "y-"),
        Support("punch", ("y",), "y+", velocity=lambda t: -0.2 if t < 1 else 0.0),
        Support("punch", ("x",), "y+", velocity=lambda t: 0.1 if t > 1 else 0.0),
    ]
    model = build_model([Body("bed", bed), Body("punch", punch, translation=(0.6, 1.0))], supports=supports)
    below, above = contact_surface(model, [("punch", "y-")]), contact_surface(model, [("bed", "y+")])
    detector = Detector([SurfacePair(below, above, mu, 0.05, **rule)], model.n_nodes)
    anywhere = Limits(rotation=np.inf, strain=np.inf)
    settings = SolverSettings(tol=1e-12, loop=loop)
    return list(Simulation(model, detector, QuasiStatic(0.5), 4, settings, limits=anywhere, witness=None))


@pytest.mark.parametrize(("rule", "order"), [({}, 2.0), ({"normals": "smooth"}, 2.0)])
def test_bodies_and_contacts_in_one_loop_converge_quadratically_to_the_answer_of_the_sequence(rule: dict[str, str], order: float) -> None:
    """Nodes on facets among which some stick, whose slips the tangent has to know: without that 4.7e-5 leaves 4e-9."""
    one, sequence = pressed("one", 0.3, **rule), pressed("sequence", 0.3, **rule)
    for a, b in zip(one, sequence, strict=True):
        assert_allclose(a.state.x, b.state.x, atol=1e-8)
        assert all(problem.result.iterations <= 1 for problem in a.linearised[1:])
        e = [max(problem.residual, problem.result.error) for problem in a.linearised]
        assert e[-1] < 1e-9
        last, then = next((a, b) for a, b in zip(e[::-1], e[-2::-1], strict=False) if a > 1e-13 and b > 1e-7)
        assert last < then**order, e  # of relative size: a first order of 0.01 would leave 1e-6 of 1e-4, and 1e-5 of 1e-3


def test_expected_motion_is_on_the_line_through_the_last_two() -> None:
    state, h, zero = State(0.3, np.zeros(2), np.zeros(2)), 0.1, np.zeros(0, dtype=np.int64)
    first = with_motion(Memory.of(zero), replace(state, t=0.1), h, np.array([1.0, 2.0]))
    assert expected_motion(first, state, h) is None  # of another time
    second = with_motion(first, replace(state, t=0.2), h, np.array([1.5, 2.0]))
    motion = expected_motion(second, state, h)
    assert motion is not None
    assert_allclose(motion, [2.0, 2.0])
    again = expected_motion(with_motion(second, replace(state, t=0.2), h, np.array([1.0, 1.0])), state, h)
    assert again is not None
    assert_allclose(again, [1.0, 0.0])  # the step was solved once more
    assert expected_motion(second, state, 0.5 * h) is None and expected_motion(None, state, h) is None


def test_unknown_loop_is_refused() -> None:
    with pytest.raises(InputError, match="option loop: expected one of"):
        SolverSettings(loop="two")


def struck(loop: str) -> list[Step]:
    """A block that rocks on the ground while another one strikes the ground at 300 m/s, far away."""
    ground = rigid_rectangle("ground", (20.0, 0.2), (0.0, -0.1), 1.0)
    stone, steel = Material(E=1e8, nu=0.2, density=2000.0), Material(E=1e12, nu=0.2, density=8000.0)
    rocking, small = rectangle("rocking", (0.2, 0.4), (3, 6), stone), rectangle("small", (0.1, 0.1), (1, 1), steel)
    bodies = [Body("rocking", rocking, translation=(-0.2, 0.0)), Body("small", small, translation=(3.0, 1.05)), ground]
    model = build_model(
        bodies, supports=[Support("ground", ("x", "y", "rz"))], gravity=lambda t: (0.0, -9.81), beta=1e-4, kinematics="turning"
    )
    X, v = model.reference[: len(rocking.points)], np.zeros(model.n_dofs)
    v[: X.size] = 10.0 * np.column_stack([X[:, 1], -X[:, 0]]).ravel()
    v[X.size + 1 : model.n_elastic : 2] = -300.0
    settings = SolverSettings(name="NSN-AC", tol=TOL, loop=loop)
    start = State(0.0, np.zeros(model.n_dofs), v)
    return list(Simulation(model, Everything(model, 0.5), Theta(1e-3), 6, settings, initial=start, witness=None))


def left_at_the_end(step: Step) -> FloatArray:
    """What the state at the end of a step of Theta leaves of each body's equation of motion, relative to the largest of its terms."""
    model, scheme, before, after = step.model, step.scheme, step.previous, step.state
    assert isinstance(scheme, Theta) and not model.alpha
    h, theta, elastic = scheme.h, scheme.theta, model.elastic
    mean = theta * after.v + (1 - theta) * before.v
    inner = elastic.force(elastic.at(before.x), elastic.at(after.x), theta, mean)
    terms = [
        model.apply_mass(after.v),
        -model.apply_mass(before.v),
        h * inner,
        -h * model.load(before.t, before.x),
        -step.H @ step.reaction,
    ]
    ends = model.dof_offset[: len(model.deformable)]
    sizes = [np.sqrt(np.add.reduceat(np.square(term[: model.n_elastic]), ends)) for term in (*terms, np.sum(terms, axis=0))]
    left: FloatArray = sizes[-1] / np.max(sizes[:-1], axis=0)
    return left


def test_a_body_has_settled_by_itself_beside_one_that_an_impact_throws_about() -> None:
    """The velocity that the impact changes says nothing of the forces of the body that turns elsewhere."""
    steps = struck("one")
    assert any(np.abs(step.state.v - step.previous.v).max() > 100.0 for step in steps)  # the impact
    assert any(step.contacts.bodies.size and np.any(step.contacts.bodies == 0) and step.result.r.any() for step in steps)
    for step in steps:
        assert step.substeps == 1 and not step.fell_back
        assert left_at_the_end(step)[0] < 1e-9


def following(first: float) -> FollowedLoad:
    """The problem of a step of the block, first linearised at its last velocity times `first`."""
    step = next(step for step in thrown("sequence") if step.problem.nc > 1 and np.count_nonzero(step.result.r) > 2)
    model, scheme, state = step.model, step.scheme, step.previous
    elastic = Linearisation(scheme, model, state)
    rest = scheme.right_hand_side(model, state)
    factor = SystemFactor(model, *scheme.factors(model), np.arange(model.n_nodes)).turned(elastic.rotation)
    equation = Equation(scheme, model, state, step.encounter, factor, rest, scheme.driven(model, state), elastic, 1.0)
    load = rest - elastic.term(first * state.v)
    problem = equation.problem(load)
    assert isinstance(problem, GlobalProblem)
    return FollowedLoad(equation, problem, Reduction(problem, equation.compliance), load)


def test_reactions_without_forces_of_finite_numbers_have_no_answer() -> None:
    """As an iterate of a method that diverges may be; the problem stays what it was."""
    problem = following(1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        problem.answer(np.full(len(problem.q), 1e200))
    assert not problem.settled and np.all(np.isfinite(problem.reduction.q))
    problem.answer(np.zeros(len(problem.q)))
    assert problem.settled


@pytest.mark.parametrize(("loop", "failed"), [("auto", False), ("one", True)])
def test_one_loop_that_nobody_asked_for_is_no_link_of_the_chain(monkeypatch: pytest.MonkeyPatch, loop: str, failed: bool) -> None:
    """Where it does not arrive the settings' solver goes on from the same reactions: a failure only of what was asked for."""

    def diverges(*args: Any, **options: Any) -> Result:
        return replace(solve(*args, **options), status=Status.DIVERGED)

    monkeypatch.setattr("fcsim.timestep.step_equation.loops.one_loop.solve", diverges)
    touching = next(step for step in thrown.__wrapped__(loop) if step.problem.nc)
    first, second, *_ = touching.attempts
    assert first.status == "diverged" and second.status == "solved"
    assert ("in one loop: diverged" in str(first)) is not failed and touching.fell_back is failed


def test_error_of_the_one_loop_is_that_of_the_problem_it_ends_with() -> None:
    """Begun far from the motion, with a q of another size."""
    problem, attempts = following(30.0), list[Attempt]()
    settings = SolverSettings(name="NSN-AC", tol=1e-6)
    result, _ = solve_followed(problem, Chain(settings, 1.0, attempts), np.zeros(len(problem.q)), lambda _: settings.tol, None)
    assert result is not None and attempts[-1].error == result.error > 0
    first, last = (float(np.linalg.norm(q)) for q in (problem.q, problem.reduction.q))
    assert abs(first - last) > 1e-3 * last
    assert_allclose(result.error, scaled_error(problem.reduction.local, result.r), rtol=1e-5)


def test_one_loop_is_passed_over_where_newton_pauses() -> None:
    """Of the problem nothing is asked."""
    memory, attempts = Memory.of(np.arange(1)).having(Pause(np.empty(0, dtype=np.int64), length=4, left=3)), list[Attempt]()
    nothing: Any = None
    result, left = solve_followed(nothing, Chain(SolverSettings(name="auto"), 1.0, attempts), np.zeros(3), nothing, memory)
    assert left is not None and (pause := left.earlier(Pause)) is not None
    assert result is None and not attempts and pause.left == 2


def test_bodies_that_only_reactions_hold_in_statics_go_by_the_sequence() -> None:
    """Under reactions that are held they would fly away by what is wrong with these, over eta."""
    stone = Material(E=1e6, nu=0.2, density=2000.0)
    part = rectangle("block", (0.2, 0.1), (4, 2), stone)
    bodies = [Body("lower", part), Body("upper", part, translation=(0.02, 0.1)), rigid_rectangle("ground", (10.0, 0.4), (0.0, -0.2), 1.0)]
    supports = [
        Support("ground", ("x", "y", "rz")),
        Support("upper", ("y",), "y+", velocity=lambda t: -0.01),
        Support("upper", ("x",), "y+", velocity=lambda t: 0.01),
    ]
    model = build_model(bodies, supports=supports, gravity=lambda t: (0.0, -9.81), kinematics="turning")
    settings = SolverSettings(name="NSN-AC")
    for step in Simulation(model, Everything(model, 0.5), QuasiStatic(0.1, eta=1e-3), 2, settings, witness=None):
        assert step.result.r.any() and not step.fell_back
