"""fcsim: frictional contact between deformable bodies, from mesh to FCLIB file."""

from fcsim import runtime as _runtime

_runtime.limit_threads()

__version__ = "0.1.0"
