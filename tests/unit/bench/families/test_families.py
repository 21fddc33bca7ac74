"""Families of problems: what mechanics says of each, whatever the size and the seed."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.optimize
import scipy.sparse as sp

from fcsim.bench.families import FAMILIES, problems
from fcsim.bench.families.assembly import ball_inertia, box_inertia, frames
from fcsim.bench.families.blocks import bond, faces
from fcsim.bench.families.grains import packing
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem, LocalProblem

GLOBAL = [name for name in FAMILIES if name != "noise"]


@pytest.mark.parametrize("name", FAMILIES)
def test_the_same_arguments_give_the_same_problem_and_another_seed_another(name: str) -> None:
    one, same, other = (problems(name, 12, seed) for seed in (3, 3, 4))
    key = "q" if isinstance(one, LocalProblem) else "f"
    assert np.array_equal(getattr(one, key), getattr(same, key))
    assert not np.array_equal(getattr(one, key), getattr(other, key))
    assert one.dimension == FAMILIES[name].dimension
    assert FAMILIES[name].about.endswith((".", ":")) or FAMILIES[name].about


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("size", [1, 40, 900])
def test_about_as_many_contacts_as_asked_for(name: str, size: int) -> None:
    nc = problems(name, size, 0).nc
    assert 0.4 * size <= nc <= 2 * size + 40


@pytest.mark.parametrize("name", [name for name in GLOBAL if name not in ("rods", "near-singular")])
def test_contacts_between_bodies_obey_action_and_reaction(name: str) -> None:
    """H r leaves the momentum of all bodies alone: the forces of a contact that touches no held body sum to zero, as do their moments
    about any point; here the forces."""
    p = problems(name, 60, 1)
    assert isinstance(p, GlobalProblem)
    d, k = p.dimension, 3 if p.dimension == 2 else 6
    H = sp.csc_array(p.H).toarray().reshape(p.n // k, k, p.m)
    touched = np.any(H != 0, axis=1).sum(axis=0)
    forces = H[:, :d].sum(axis=0)
    between = touched == 2
    assert np.allclose(forces[:, between], 0, atol=1e-12)
    assert np.allclose(np.linalg.norm(forces[:, touched == 1], axis=0), 1)  # unit normals and tangents


@pytest.mark.parametrize("name", GLOBAL)
def test_masses_are_positive(name: str) -> None:
    p = problems(name, 60, 2)
    assert isinstance(p, GlobalProblem)
    M = sp.csr_array(p.M).toarray()
    assert np.allclose(M, M.T) and np.linalg.eigvalsh(M).min() > 0


def test_stacks_of_boxes_are_rank_deficient() -> None:
    for name in ("boxes", "walls", "towers", "near-singular"):
        p = problems(name, 80, 0)
        assert isinstance(p, GlobalProblem)
        assert np.linalg.matrix_rank(sp.csr_array(p.H).toarray()) < p.m


def test_a_tower_of_two_boxes_meets_the_ground_and_one_another_at_four_points() -> None:
    centre, half = np.array([[0.0, 0, 0.5], [0.2, 0, 1.5], [0.0, 0, -0.5]]), np.array([[0.5, 0.5, 0.5]] * 2 + [[3.0, 3.0, 0.5]])
    touching = faces(centre, half)
    assert len(touching) == 8
    upper = touching.point[touching.point[:, 2] == 1.0]
    assert sorted(map(tuple, np.round(upper, 12).tolist())) == [(-0.3, -0.5, 1.0), (-0.3, 0.5, 1.0), (0.5, -0.5, 1.0), (0.5, 0.5, 1.0)]


def test_running_bond_has_two_bricks_above_each_brick_and_no_gap() -> None:
    centre, half, held = bond(4, 3, 2)
    assert held.sum() == 1
    area = np.prod(2 * half[held == 0], axis=1).sum()
    assert area == pytest.approx(4 * 3 * 2.0)
    assert len(faces(centre, half)) > 0


def test_inertia_of_a_cube_and_of_a_ball() -> None:
    assert np.allclose(box_inertia(np.array([[0.5, 0.5, 0.5]]), np.array([6.0]))[0], np.eye(3))  # m s^2 / 6
    assert np.allclose(ball_inertia(np.array([2.0]), np.array([5.0]), 3)[0], 8 * np.eye(3))  # 2/5 m r^2
    assert box_inertia(np.array([[0.5, 1.0]]), np.array([12.0]))[0, 0, 0] == pytest.approx(5.0)  # m (a^2 + b^2) / 12


def test_frames_are_right_handed() -> None:
    normal = np.random.default_rng(0).standard_normal((50, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    frame = frames(normal)
    assert np.allclose(frame @ frame.transpose(0, 2, 1), np.eye(3)) and np.allclose(np.linalg.det(frame), 1)


def test_balls_of_a_packing_hardly_overlap() -> None:
    x, radius, width = packing(200, 3, np.random.default_rng(0))
    distance = np.linalg.norm(x[:, None] - x, axis=2) + 10 * np.eye(200)
    assert np.mean(np.maximum(radius[:, None] + radius - distance, 0).max(axis=1)) < 0.04
    assert np.all(np.abs(x[:, :2]) <= width) and np.all(x[:, 2] >= radius - 1e-12)


@pytest.mark.parametrize("name", ["squeezed", "wedged"])
def test_squeezed_bodies_have_no_velocity_that_keeps_them_apart(name: str) -> None:
    """Linear programming over all velocities v: the largest t with u_N >= t is negative."""
    p = problems(name, 6, 0)
    assert isinstance(p, GlobalProblem)
    N = sp.csr_array(p.H).T[:: p.dimension]
    A = sp.hstack([-N, np.ones((p.nc, 1))])
    found = scipy.optimize.linprog(np.r_[np.zeros(p.n), -1.0], A_ub=A, b_ub=p.w[:: p.dimension], bounds=[(None, None)] * (p.n + 1))
    assert found.status == 0 and -found.fun < -1e-3


def test_a_rod_of_painleve_has_no_solution_in_any_of_its_cases() -> None:
    """Open, sliding either way, sticking, by hand: one degree of freedom a rod."""
    p = problems("rods", 5, 0)
    assert isinstance(p, GlobalProblem)
    H = sp.csr_array(p.H).toarray()
    inertia = p.M.diagonal()
    for rod in range(5):
        a, b = H[rod, 2 * rod : 2 * rod + 2]
        free, I, mu, s = p.f[rod] / inertia[rod], inertia[rod], p.mu[rod], p.w[2 * rod + 1]
        assert a * free < 0  # it cannot open
        # in contact with the floor u_N = a w = 0, so w = 0 and u_T = s > 0: it slides, r_T = -mu r_N
        r_N = -I * free / (a - mu * b)
        assert s > 0 and r_N < 0


def test_bad_arguments_are_named() -> None:
    with pytest.raises(InputError, match="family 'sphere': expected one of spheres"):
        problems("sphere", 10, 0)
    with pytest.raises(InputError, match="size: expected"):
        problems("spheres", 0, 0)
    with pytest.raises(InputError, match="seed: expected"):
        problems("spheres", 10, -1)
