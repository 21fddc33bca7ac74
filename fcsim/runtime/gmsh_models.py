"""The door to gmsh."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from fcsim.errors import InputError, MissingDependency
from fcsim.runtime.signal_handlers import restore_signal_handlers

_GMSH = threading.RLock()


def _free_gmsh() -> None:
    """In a child: the thread that may hold the lock is not there."""
    global _GMSH
    _GMSH = threading.RLock()


os.register_at_fork(after_in_child=_free_gmsh)


@contextmanager
def gmsh_model(name: str) -> Iterator[ModuleType]:
    """Yield the gmsh module with a new, empty model; gmsh is finalised however the block ends.

    gmsh's own signal handlers and terminal output are off: errors come as exceptions. InputError where the program works with gmsh itself:
    its models and options are not ours, and what it has set would change our meshes.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: the wheel's library misses a system library
        raise MissingDependency(
            f"gmsh cannot be imported ({error}): pip install 'fcsim[fem]'; its wheel loads X and GL libraries, on Debian: "
            "apt-get install libglu1-mesa libxcursor1 libxft2 libxinerama1 libxrender1 libxext6"
        ) from None
    with _GMSH:
        if gmsh.isInitialized():
            raise InputError(
                f"mesh of {name!r}: expected gmsh to be free, and it is in use (gmsh.initialize(), or a block of gmsh_model): make the "
                "mesh before, or after gmsh.finalize()"
            )
        gmsh.initialize(interruptible=False, argv=["", "-nopopup"], readConfigFiles=False)  # options of a user's home would change meshes
        restore_signal_handlers()
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.add(name)
            yield gmsh
        finally:
            gmsh.finalize()
            restore_signal_handlers()
