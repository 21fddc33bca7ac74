"""Forms compiled to machine code by ffcx, which keeps them in a folder that processes share (`cache_dir` of dolfinx's jit options)."""

from __future__ import annotations

import fcntl
import re
import sys
import time
import traceback
from pathlib import Path

from fcsim.errors import InputError, MissingDependency
from fcsim.runtime.libraries import dolfinx

ABANDONED = 60.0
"""[s] without a change after which whoever compiled a form is taken for dead: ffcx writes its C file, object file and library one after the
other, each in seconds."""


def compiled_form(form: object) -> object:
    """Return a form of UFL compiled to machine code (`dolfinx.fem.Form`), from the folder where it may be already.

    The first process that wants a form creates its C file, empty, and the others wait until the library is there. One that is
    interrupted takes the file with it. A process killed meanwhile leaves it, and ffcx would wait for that in every later run, ten
    seconds, in vain. So whoever has waited says so and goes on as long as files of the form change, then takes the C file away and
    compiles anew, once. MissingDependency without a C compiler, InputError that names the file where it cannot be taken away.
    """
    import numpy as np  # not with fcsim itself, which is loaded before it is known whether NumPy has room
    from cffi import VerificationError

    taken: set[Path] = set()
    told: set[Path] = set()
    while True:
        try:
            return dolfinx().fem.form(form, dtype=np.float64)
        except VerificationError as error:
            raise MissingDependency(
                f"dolfinx compiles forms with a C compiler, and this one failed ({error}): install one (on Debian: apt-get install gcc "
                "libc6-dev) or name it in the environment variable CC"
            ) from error
        except TimeoutError as error:
            source = _waited_for(error)
            if source in taken:
                raise
            if _take_away_abandoned(source):
                taken.add(source)
            elif source not in told:
                told.add(source)
                print(
                    f"fcsim: waits for a form that another process compiles ({source}); should that one have been killed, it is compiled "
                    f"here {ABANDONED:.0f} s after the file's last change",
                    file=sys.stderr,
                    flush=True,
                )
        except KeyboardInterrupt as interrupt:
            _take_along(interrupt)
            raise


def _take_along(interrupt: KeyboardInterrupt) -> None:
    """Remove the C file of the form that this process was compiling when it was interrupted; ffcx does so after errors alone. Its frame
    knows which: one that waits for another process has none."""
    for frame, _ in traceback.walk_tb(interrupt.__traceback__):
        if frame.f_code.co_name == "_compile_objects" and {"cache_dir", "module_name"} <= frame.f_locals.keys():
            Path(frame.f_locals["cache_dir"], f"{frame.f_locals['module_name']}.c").unlink(missing_ok=True)


def _waited_for(error: TimeoutError) -> Path:
    """The C file of ffcx's message, "... (e.g. remove FILE) ...", which nothing else tells; the error itself where it says none."""
    named = re.search(r"remove (.+\.c)\)", str(error))
    if named is None:
        raise error
    return Path(named[1])


def _take_away_abandoned(source: Path) -> bool:
    """Remove the C file of a form that nobody compiles any more, and say so. A change in the future is none: clocks are set back."""
    try:
        with source.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX)  # of several that waited the second sees what the first made anew, under the same name
            if abs(time.time() - _last_change(source)) < ABANDONED or source.with_suffix(".c.cached").exists():
                return False
            source.unlink()
            return True
    except FileNotFoundError:  # another took it away first
        return False
    except OSError as error:
        raise InputError(
            f"{source}: expected the C code of a compiled form, got what a process left that was killed while it compiled, and which "
            f"cannot be removed ({error.strerror}): remove the file"
        ) from error


def _last_change(source: Path) -> float:
    """[s] since the epoch, of the form's files: C, object file, library, whose names begin with its own."""
    return max(file.stat().st_mtime for file in [source, *source.parent.glob(f"{source.stem}*")])
