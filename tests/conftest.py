"""Before any test imports NumPy: fcsim limits the threads of BLAS, which fight with those of other processes."""

import fcsim  # noqa: F401
