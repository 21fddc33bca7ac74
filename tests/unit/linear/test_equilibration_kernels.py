import numpy as np
import scipy.sparse as sp

from fcsim.linear._equilibration_kernels import equilibrating_scale


def test_equilibrating_scale() -> None:
    """Rows and columns of units eight orders apart get largest entries between 0.9 and 1.1; an empty one keeps its scale."""
    rng = np.random.default_rng(2)
    units = 10.0 ** rng.uniform(-4, 4, 20)
    A = units[:, None] * rng.uniform(0.5, 1, (20, 20)) * (rng.random((20, 20)) < 0.3) * units
    A[3], A[:, 3] = 0, 0
    S = sp.csr_array(A)
    scale = equilibrating_scale(S.indptr, S.indices, S.data, 20)
    scaled = np.abs(scale[:, None] * A * scale)
    largest = np.delete(np.maximum(scaled.max(axis=0), scaled.max(axis=1)), 3)
    assert scale[3] == 1
    assert np.all((largest > 0.9) & (largest < 1.1))
