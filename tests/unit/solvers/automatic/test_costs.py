"""Costs: counts by the algorithms' own formulas, on matrices whose elimination is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.bench.families import problems
from fcsim.linear.joints import BlockRows
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers.automatic.costs import REFERENCE, Machine, Prices, Work, lu_flops, sweep


def banded(nc: int) -> LocalProblem:
    """Contacts in a row, each coupled with the next: an elimination without fill."""
    pattern = sp.diags_array([np.ones(nc - 1), 4 * np.ones(nc), np.ones(nc - 1)], offsets=[-1, 0, 1])
    W = sp.bsr_array(sp.kron(pattern, np.eye(3) + 0.1), blocksize=(3, 3))
    return LocalProblem(W, np.ones(3 * nc), np.ones(nc))


def test_work_adds_up_and_takes_time_by_three_rates() -> None:
    work = 2 * (Work(3.0, 5.0, 7.0) + Work(flops=1.0))
    assert (work.flops, work.bytes, work.steps) == (8.0, 10.0, 14.0)
    assert Machine(flops=4.0, bytes=5.0, step=0.5).seconds(work) == pytest.approx(2 + 2 + 7)


def test_lu_of_a_dense_matrix() -> None:
    assert lu_flops(LocalProblem(np.eye(30), np.ones(30), np.ones(10))) == pytest.approx(2 / 3 * 30**3)


def test_lu_of_a_row_of_contacts_grows_with_their_number_only() -> None:
    short, long = lu_flops(banded(200)), lu_flops(banded(2000))
    assert long == pytest.approx(10 * short, rel=0.3)
    assert long < 1e-3 * 2 / 3 * 6000**3


def test_a_sweep_costs_entries_and_contacts() -> None:
    assert sweep(2000, 100).bytes == 2 * sweep(1000, 100).bytes
    assert sweep(1000, 200).flops == 2 * sweep(1000, 100).flops
    flat = LocalProblem(np.eye(20), np.ones(20), np.ones(10), dimension=2)
    assert Prices(flat, 40, None).sweep == Prices(LocalProblem(np.eye(30), np.ones(30), np.ones(10)), 90, None).sweep  # ten blocks each


def test_prices_are_in_the_order_of_what_is_done() -> None:
    problem = banded(2000)
    prices = Prices(problem, problem.W.nnz, None)
    assert 0 < prices.sweep < prices.newton(0) < prices.splitting(30) < prices.least_squares(6000)
    assert prices.splitting(31) - prices.splitting(30) == pytest.approx(prices.admm)
    quicker = Prices(problem, problem.W.nnz, None, Machine(2 * REFERENCE.flops, 2 * REFERENCE.bytes, 0.5 * REFERENCE.step))
    assert quicker.newton(0) == pytest.approx(0.5 * prices.newton(0))  # only ratios matter to the race


@pytest.mark.parametrize("storage", [np.asarray, sp.bsr_array])
def test_open_contacts_cost_newton_nothing(storage: type) -> None:
    """They leave the system: LU of what is left, in 2/3 c^3 operations where W is dense; all closed costs what is not known."""
    W = banded(100).W
    problem = LocalProblem(W.toarray() if storage is np.asarray else W, np.ones(300), np.ones(100))
    prices = Prices(problem, W.nnz, None, Machine(1.0, float("inf"), 0.0))
    assert prices.newton(300) == prices.newton(0) > prices.newton(150) > prices.newton(30)
    if storage is np.asarray:
        assert prices.newton(30) == pytest.approx(2 / 3 * 30**3)


def test_proximal_newton_once_begun_costs_the_small_steps_that_were_measured() -> None:
    """80 on a sparse W, where 200 are asked for before it begins; on a dense one they are the same."""
    sparse = banded(200)
    prices = Prices(sparse, sparse.W.nnz, None, Machine(float("inf"), float("inf"), 1.0))
    assert (prices.proximal(0), prices.running(0)) == (200, 80)
    dense = LocalProblem(np.eye(30), np.ones(30), np.ones(10))
    prices = Prices(dense, 30, None)
    assert prices.running(30) == prices.proximal(30) > 0


def test_proximal_newton_in_joints_eliminates_what_is_closed() -> None:
    """LU of a single joint of 240 unknowns, of which c are closed: 2/3 c^3 operations; none closed: nothing is known of them."""
    W = np.eye(240) + 1.0
    problem = LocalProblem(sp.bsr_array(W, blocksize=(3, 3)), np.ones(240), np.ones(80))
    prices = Prices(problem, W.size, BlockRows(W, 3), Machine(flops=1.0, bytes=np.inf, step=0.0))
    for closed, unknowns in ((60, 60), (120, 120), (240, 240), (0, 240)):
        assert prices.running(closed) == pytest.approx(2 / 3 * unknowns**3, rel=0.05)


def test_an_iteration_of_admm_reads_the_factor_twice() -> None:
    """A tridiagonal matrix of blocks fills in nothing: half of its entries, and half of the diagonal blocks."""
    problem = banded(50)
    prices = Prices(problem, problem.W.nnz, None, Machine(float("inf"), 8.0, 0.0))
    assert prices.admm >= problem.W.nnz + 2 * 9 * 99
    assert prices.admm < prices.least_admm


def test_the_analysis_that_is_counted_is_the_one_that_factors() -> None:
    problem = banded(200)
    assert lu_flops(problem) == problem.delassus.analysis[1].flops
    factor = problem.delassus.factor(0.0, symmetric=True)
    x = np.random.default_rng(0).standard_normal(600)
    assert np.linalg.norm(factor.solve(problem.W @ x) - x) < 1e-10 * np.linalg.norm(x)


def test_proximal_newton_of_blocks_is_priced_by_their_number_not_by_their_contacts() -> None:
    """Twice the points of a face: the same bodies' matrix, whose elimination is all that counts where nothing but operations costs."""
    wall = problems("walls", 300, 1)
    assert isinstance(wall, GlobalProblem)
    twice = replace(wall, H=sp.csc_array(sp.hstack([wall.H, wall.H])), w=np.tile(wall.w, 2), mu=np.tile(wall.mu, 2))
    machine = Machine(1.0, float("inf"), 0.0)
    prices = [Prices(local, local.delassus.entries, None, machine) for local in (reduce(wall).local, reduce(twice).local)]
    assert all(own.in_velocities for own in prices)
    assert prices[0].proximal(0) == prices[1].proximal(0)
    assert prices[1].newton(0) > 5 * prices[1].proximal(0)
    other = Prices(replace(reduce(wall).local, motion=None), 0, None, machine)
    assert not other.in_velocities and other.proximal(0) == other.newton(0)


@pytest.mark.parametrize("family", ["boxes", "rocks", "spheres", "near-singular", "arches"])
def test_what_is_known_before_anything_is_analysed_is_no_more_than_the_price(family: str) -> None:
    local = reduce(problems(family, 240, 1)).local
    fitting = local.stored()
    prices = Prices(fitting, local.delassus.entries, local.delassus.joints)
    assert 0 < prices.least_splitting(30) <= prices.splitting(30)
    if prices.in_velocities:
        assert 0 < prices.least_in_velocities <= prices.proximal(0)


@pytest.mark.parametrize("family", ["walls", "rocks", "towers"])
def test_the_bodies_behind_a_matrix_go_with_its_storage(family: str) -> None:
    """Without them proximal Newton of rigid blocks is priced, and made, by its contacts."""
    local = reduce(problems(family, 240, 1)).local
    assert local.delassus.motion is not None and local.stored().delassus.motion is not None
    held = local.W.copy()
    held.data.flags.writeable = False
    motion = local.motion.stored_as(local.W, held)
    assert replace(local, W=held, motion=motion).delassus.motion is not None


def test_a_piece_of_a_path_costs_a_part_of_an_elimination_and_no_contacts_own_equations() -> None:
    """Walls of rigid bricks and arches: what Newton's iterations pay for each contact beside the elimination is not in it."""
    for family, contacts in (("walls", 600), ("arches", 2000)):
        made = problems(family, contacts, 3)
        problem = (made if isinstance(made, LocalProblem) else reduce(made).local).stored()
        prices = Prices(problem, problem.delassus.entries, None)
        assert prices.in_velocities
        assert 0 < prices.piece < 0.5 * prices.proximal(0)
        assert prices.piece < prices.running(0)


def test_compiled_iterations_in_the_bodies_velocities_cost_six_tenths_of_their_count() -> None:
    """Up to 600 velocities, as measured (`costs.COMPILED`; 0.85 in the plane); a contact's own equations are 0.3 and 1 microseconds
    there and beyond."""
    for family, contacts, factor, own in (("walls", 300, 0.6, 0.3e-6), ("arches", 300, 0.85, 0.3e-6), ("walls", 2000, 1.0, 1e-6)):
        made = problems(family, contacts, 3)
        assert isinstance(made, GlobalProblem)
        problem = reduce(made).local.stored()
        prices = Prices(problem, problem.delassus.entries, None)
        assert (made.M.shape[0] <= 600) == (factor < 1)
        assert prices.running(0) == pytest.approx(factor * (prices.proximal(0) + own * problem.nc))
