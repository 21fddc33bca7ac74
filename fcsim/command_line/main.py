"""The command line: fcsim run | solve | info | render, compare | solvers | collection | bench | profile, report | limit, tilt, push,
shake, a file beside for each of these."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from fcsim.command_line import bench, collection, info, masonry, profile, render, run, solve, solvers
from fcsim.command_line.terminal import any_encoding, open_streams, refuse, say, silence
from fcsim.errors import EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_OK, FcsimError, InputError
from fcsim.interrupts import ended_by, is_interrupt
from fcsim.runtime import limited_threads
from fcsim.version import __version__


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsim",
        description="Frictional contact between deformable bodies: run cases, solve and describe FCLIB problems.",
        epilog="Exit codes: 0 all converged, 1 no convergence or penetration seen, 2 bad input, 130 interrupted.",
    )
    parser.add_argument("--version", action="version", version=f"fcsim {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    for command in (run, solve, info, render, solvers, collection, bench, profile, masonry):
        command.add_parser(commands)
    return parser


RANKS = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_SIZE", "MPI_LOCALNRANKS")


def _refuse_ranks(command: str, launcher: str | None) -> None:
    """Each rank of `mpiexec -n 2 fcsim run` would make the whole run, into one folder; so with all that writes, but for a bench whose
    launcher shares its measurements among the ranks."""
    if launcher == "mpi":
        return
    ranks = max((int(os.environ[name]) for name in RANKS if os.environ.get(name, "").isdecimal()), default=1)
    if ranks > 1:
        raise InputError(f"fcsim {command}: expected one process, got {ranks} ranks of MPI, which do not share their work yet")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    open_streams()
    any_encoding()
    options = _parser().parse_args(arguments)
    try:
        _refuse_ranks(options.command, getattr(options, "launcher", None))
        with limited_threads():
            return int(options.act(options))
    except FcsimError as error:
        refuse(error)
        return EXIT_BAD_INPUT
    except SystemExit as error:  # of a case's sensor: the run has failed, whatever it says
        say(f"fcsim: a script ended the program (SystemExit: {error})", to_stderr=True)
        return EXIT_BAD_INPUT
    except BrokenPipeError:  # the reader of our output left, as `head` does
        silence(sys.stdout)
        return EXIT_OK
    except OSError as error:  # a folder that cannot be written, a full disk
        refuse(error)
        return EXIT_BAD_INPUT
    except (KeyboardInterrupt, SystemError) as error:
        if not is_interrupt(error):
            raise
        say(f"fcsim: interrupted by {ended_by(error)}", to_stderr=True)
        return EXIT_INTERRUPTED


if __name__ == "__main__":
    raise SystemExit(main())
