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
