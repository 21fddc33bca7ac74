"""The working directory is a place, not a source: what libraries would take from it as they load, options and programs, is kept from them.

numba reads .numba_config.yaml there (where compiled functions are loaded from), dolfinx dolfinx_jit_options.json (arguments of the C
compiler), PETSc .petscrc (files it writes, libraries it loads), matplotlib matplotlibrc (programs it calls), and `python -c` every module.
A folder of somebody else's results would run their code in the one who looks at it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

ELSEWHERE = Path(os.sep)
ISOLATED = "-P"
"""Of Python: no modules from the working directory."""


@contextmanager
def without_local_options() -> Iterator[None]:
    """Load libraries, and have them read their options, as if the working directory held nothing; the user's own, in HOME, count.

    The directory is the process's: other threads see the change for as long as the block lasts.
    """
    try:
        here = os.open(os.curdir, getattr(os, "O_PATH", os.O_RDONLY))
    except OSError:  # removed, or not to be read: nothing can come from it
        yield
        return
    try:
        os.chdir(ELSEWHERE)
        yield
    finally:
        os.fchdir(here)
        os.close(here)


def load_numba_alone() -> None:
    """Import numba without the working directory's options, where there are some; it is loaded when it is used otherwise."""
    if Path(".numba_config.yaml").is_file():
        with without_local_options():
            import_module("numba")
