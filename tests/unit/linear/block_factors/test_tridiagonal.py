"""Bodies' matrices by blocks that are coupled to their neighbours alone, beside LAPACK's dense factor and products with the matrix."""

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.assembly.elasticity import consistent_mass, stiffness
from fcsim.linear.block_factors.tridiagonal import CONDITIONING, BlockTridiagonal, factorise_body, find_layers
from fcsim.linear.factors import DenseCholesky, SingularMatrix
from fcsim.mesh import Material, brick


def body(divisions, share=1e-8):
    part = brick("brick", (0.2, 0.1, 0.08), divisions, Material(E=5e9, nu=0.2, density=2000.0))
    K, M = stiffness(part), consistent_mass(part)
    A = sp.csr_array(M + share * K)
    return A, np.repeat(part.points, 3, axis=0)


@pytest.mark.each_value
@pytest.mark.parametrize("divisions", [(8, 4, 4), (4, 4, 4), (3, 9, 3)])
@pytest.mark.parametrize("columns", [(), (1,), (9,)])
def test_solutions_are_those_of_the_dense_factor(divisions, columns):
    A, points = body(divisions)
    layers = find_layers(A, points)
    factor, rhs = factorise_body(A, layers), np.random.default_rng(0).standard_normal((A.shape[0], *columns))
    assert isinstance(factor, BlockTridiagonal)
    found, dense = factor.solve(rhs), DenseCholesky(A.toarray())
    assert np.abs(found - dense.solve(rhs)).max() < 1e-10 * np.abs(found).max()
    own, other = (np.linalg.norm(A @ x - rhs) for x in (found, dense.solve(rhs)))
    assert own < 5 * other
    assert 0.1 < factor.conditioning / dense.conditioning < 10
    with pytest.raises(SingularMatrix, match="not positive definite"):
        factorise_body(sp.csr_array(A - 0.5 * sp.diags_array(A.diagonal().max() * np.ones(A.shape[0]))), layers)


def test_each_layer_is_coupled_to_its_neighbours_alone():
    A, points = body((8, 4, 4))
    order, ends = find_layers(A, points)
    assert np.array_equal(np.sort(order), np.arange(A.shape[0]))
    assert np.array_equal(np.diff(ends, prepend=0), np.full(9, 75))  # the planes of nodes across the longest edge
    layer = np.empty_like(order)
    layer[order] = np.searchsorted(ends, np.arange(len(order)), side="right")
    row, column = A.nonzero()
    assert np.abs(layer[row] - layer[column]).max() == 1


def test_what_the_dense_factor_does_as_well_is_left_to_it():
    A, points = body((2, 2, 2))
    assert find_layers(A, points) is None  # few unknowns
    full = sp.csr_array(np.eye(300) + 1e-3)
    assert find_layers(full, np.random.default_rng(0).random((300, 3))) is None  # all coupled to all
    A, points = body((8, 4, 4), share=1.0)  # held by a mass of 1e-10 of its stiffness
    layers = find_layers(A, points)
    assert BlockTridiagonal(A.toarray(), *layers).conditioning < CONDITIONING
    assert isinstance(factorise_body(A, layers), DenseCholesky)


@pytest.mark.parametrize(
    ("size", "divisions", "law"),
    [
        ((0.2, 0.1, 0.08), (8, 4, 4), Material(E=1e7, nu=0.499999, density=1000.0)),
        ((0.2, 0.1, 0.08), (8, 4, 4), Material(E=1e7, nu=0.4999, density=1000.0)),
        ((1.0, 1.0, 0.002), (6, 6, 1), Material(E=2.1e11, nu=0.3, density=7850.0)),
        ((2.0, 0.02, 0.02), (6, 3, 3), Material(E=2.1e11, nu=0.3, density=7850.0)),
    ],
    ids=["nearly incompressible", "nu = 0.4999", "thin plate", "slender cells"],
)
def test_digits_are_kept_where_pivots_look_well(size, divisions, law):
    """The pivots of these are above the limit; blocks' inverses would leave 1e2 to 1e4 times the dense factor's residual."""
    part = brick("brick", size, divisions, law)
    A = sp.csr_array(consistent_mass(part) + 2.5e-7 * stiffness(part))  # theta = 1/2, steps of 1 ms
    layers = find_layers(A, np.repeat(part.points, 3, axis=0))
    by_layers, factor, dense = BlockTridiagonal(A.toarray(), *layers), factorise_body(A, layers), DenseCholesky(A.toarray())
    rhs = np.random.default_rng(1).standard_normal((A.shape[0], 3))
    own, lost, least = (np.linalg.norm(A @ one.solve(rhs) - rhs) for one in (factor, by_layers, dense))
    assert by_layers.conditioning > CONDITIONING and lost > 30 * least
    assert own < 5 * least
