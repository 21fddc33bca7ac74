"""The doors to dolfinx, PETSc and MPI."""

from __future__ import annotations

import sys
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from fcsim.errors import MissingDependency
from fcsim.memory import refuse_to_load_libraries
from fcsim.runtime.signal_handlers import restore_signal_handlers
from fcsim.runtime.working_directory import without_local_options


@cache  # the working directory is left once, not at every call
def _import(name: str) -> ModuleType:
    refuse_to_load_libraries(name)
    with without_local_options():
        module = _import_in_order(name)
    restore_signal_handlers()  # MPI may have taken some
    return module


def _import_in_order(name: str) -> ModuleType:
    if find_spec("dolfinx_solver") is not None:  # the wheel that brings dolfinx, petsc4py and MPI must be loaded before them
        import_module("dolfinx_solver")
    if has_petsc() and "petsc4py.PETSc" not in sys.modules:
        # PETSc's signal handlers would turn a closed pipe or Ctrl-C into an MPI abort
        import_module("petsc4py").init(["fcsim", "-no_signal_handler"])
        import_module("petsc4py.PETSc").Options().delValue("no_signal_handler")
    return import_module(name)


def dolfinx() -> ModuleType:
    """Return the dolfinx package (>= 0.10) with its mesh, fem and io modules loaded; MissingDependency where it is absent."""
    try:
        package = _import("dolfinx")
        for module in ("mesh", "fem", "io", "jit"):
            import_module(f"dolfinx.{module}")
        _read_options()
    except ImportError as error:
        raise MissingDependency(
            f"dolfinx is needed for assembly and cannot be imported ({error}): pip install 'fcsim[fem]', or bring dolfinx >= 0.10"
        ) from None
    return package


@cache
def _read_options() -> None:
    """Have dolfinx and ffcx read their options now, once; they keep what they read."""
    with without_local_options():
        import_module("dolfinx.jit").get_options()
        import_module("ffcx.options").get_options()


def petsc() -> ModuleType:
    """Return petsc4py.PETSc, initialised; MissingDependency where it is absent."""
    try:
        return _import("petsc4py.PETSc")
    except ImportError as error:
        raise MissingDependency(f"PETSc (petsc4py) cannot be imported ({error}): pip install 'fcsim[fem]', or bring it") from None


def mpi() -> ModuleType:
    """Return mpi4py.MPI, initialised; MissingDependency where it is absent."""
    try:
        return _import("mpi4py.MPI")
    except ImportError as error:
        raise MissingDependency(f"mpi4py cannot be imported ({error}): pip install 'fcsim[fem]', or bring it") from None


def has_petsc() -> bool:
    """Whether petsc4py is there (without loading it)."""
    return find_spec("dolfinx_solver") is not None or find_spec("petsc4py") is not None
