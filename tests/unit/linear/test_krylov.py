"""GMRES against a dense solve, and where it gives up."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear import krylov
from fcsim.linear.krylov import combined, gmres


@pytest.mark.parametrize("target", [1e-2, 1e-8])
def test_the_defect_is_the_one_asked_for_and_the_coefficients_are_those_of_the_steps(target: float) -> None:
    rng = np.random.default_rng(0)
    A = np.eye(30) + 0.1 * rng.standard_normal((30, 30))
    P, b, steps = np.linalg.inv(A + 0.01 * rng.standard_normal((30, 30))), rng.standard_normal(30), []

    def product(x: np.ndarray) -> np.ndarray:
        steps.append(x)
        return A @ x

    found = gmres(product, lambda x: P @ x, b, target * float(np.linalg.norm(b)), 20)
    assert found is not None
    x, y = found
    assert np.linalg.norm(b - A @ x) <= 1.001 * target * np.linalg.norm(b)
    assert_allclose(np.tensordot(y, steps, 1), x)
    shorter = np.column_stack([A @ step for step in steps[:-1]]) if len(steps) > 1 else np.zeros((30, 1))
    left = b - shorter @ np.linalg.lstsq(shorter, b, rcond=None)[0]
    assert np.linalg.norm(left) > target * np.linalg.norm(b)  # the least iterations that do: one fewer has no such x


def test_nothing_is_done_for_a_small_right_side_and_nothing_returned_where_it_does_not_pay() -> None:
    rng = np.random.default_rng(1)
    A, b = rng.standard_normal((40, 40)), rng.standard_normal(40)
    x, y = gmres(lambda x: A @ x, lambda x: x, b, 1e9, 8) or (b, b)
    assert not x.any() and not len(y)
    assert gmres(lambda x: A @ x, lambda x: x, b, 1e-10, 8) is None
    assert gmres(lambda x: np.full_like(x, np.nan), lambda x: x, b, 1e-10, 8) is None
    assert gmres(lambda x: 0 * x, lambda x: x, b, 1e-10, 8) is None


def test_at_the_limit_what_is_there_is_returned_if_it_is_enough() -> None:
    rng = np.random.default_rng(2)
    A, b = np.eye(40) + 0.3 * rng.standard_normal((40, 40)), rng.standard_normal(40)
    size = float(np.linalg.norm(b))
    found = gmres(lambda x: A @ x, lambda x: x, b, 1e-10 * size, 8, 8, size)
    assert found is not None
    assert len(found[1]) == 8
    left = float(np.linalg.norm(b - A @ found[0]))
    assert 1e-10 * size < left < size
    assert gmres(lambda x: A @ x, lambda x: x, b, 1e-10 * size, 8, 8, 0.99 * left) is None


def test_on_a_plateau_it_ends_from_the_defect_on_that_is_asked_for() -> None:
    """Forty eigenvalues near one and sixty down to 1e-6: the first are dealt with in a few iterations, the rest takes tens."""
    A, b = np.diag(np.concatenate([np.linspace(1, 1.5, 40), np.logspace(-6, -2, 60)])), np.ones(100)
    b[40:] = 0.01
    size, counted = float(np.linalg.norm(b)), []
    for plateau in (0.0, 0.2, 1e-3):
        steps: list[np.ndarray] = []
        found = gmres(lambda x, steps=steps: (steps.append(x), A @ x)[1], lambda x: x, b, 1e-5 * size, 100, 100, plateau=plateau * size)  # type: ignore[misc]
        assert found is not None
        left = float(np.linalg.norm(b - A @ found[0])) / size
        assert left <= max(1e-5, plateau) * 1.001
        counted.append((len(steps), left))
    (whole, _), (early, left), (late, _) = counted
    assert early < 0.5 * whole
    assert left > 1e-3
    assert early < late
    shorter = gmres(lambda x: A @ x, lambda x: x, b, 0.0, early - 3, 100, enough=size)
    assert shorter is not None
    assert left > 0.8 * np.linalg.norm(b - A @ shorter[0]) / size  # the last three brought hardly anything


@pytest.mark.parametrize("pieces", [10**9, 7], ids=["one piece", "pieces"])
def test_classical_gram_schmidt_of_large_vectors_gives_the_same(monkeypatch: pytest.MonkeyPatch, pieces: int) -> None:
    """Eigenvalues over two decades, to 1e-9: vectors need be no more orthogonal than that."""
    A, b = np.diag(np.logspace(-2, 0, 60)) + np.triu(np.full((60, 60), 1e-3), 1), np.random.default_rng(3).standard_normal(60)
    given = (lambda x: A @ x, lambda x: x.copy(), b, 1e-9 * float(np.linalg.norm(b)), 60, 60)
    expected = gmres(*given)
    monkeypatch.setattr(krylov, "CLASSICAL_FROM", 0)
    monkeypatch.setattr(krylov, "NUMBERS_A_PIECE", pieces)
    bases: list[krylov._LargeBasis] = []
    monkeypatch.setattr(krylov, "_basis", lambda first: bases.append(krylov._LargeBasis(first)) or bases[-1])
    found = gmres(*given)
    assert expected is not None
    assert found is not None
    assert len(found[1]) == len(expected[1]) > 3 * krylov.GROWTH
    assert np.linalg.norm(b - A @ found[0]) <= 1.001e-9 * np.linalg.norm(b)
    vectors = np.concatenate(bases[0]._blocks)[: bases[0]._count]
    assert_allclose(vectors @ vectors.T, np.eye(len(vectors)), rtol=0, atol=1e-5)
    w = vectors[3] + 1e-3 * np.arange(60.0)  # what cancels by a hundred is taken twice
    assert_allclose(vectors @ bases[0].orthogonalised(w)[1], 0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("shape", [(50,), (50, 3), (0, 3)])
@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_steps_are_added_up_in_double_precision_in_any_number_of_pieces(
    shape: tuple[int, ...], precision: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same bits in one piece and in several; vectors and blocks of contacts."""
    rng = np.random.default_rng(7)
    vectors, y = [rng.standard_normal(shape).astype(precision) for _ in range(5)], rng.standard_normal(5)
    whole = combined(y, vectors)
    assert whole.dtype == np.float64
    assert_allclose(whole, np.tensordot(y, np.array(vectors, dtype=float), 1), rtol=0, atol=1e-14)
    monkeypatch.setattr(krylov, "NUMBERS_A_PIECE", 7)
    assert_array_equal(combined(y, vectors), whole)
