"""The command line: fcsim cases, new, doctor, completion | run | sweep | solve | info | render, compare | solvers | collection |
bench | profile, report | leaderboard | limit, tilt, push, shake, settle | atlas, a file beside for each of these, or in `start`, `sets`
and `masonry`."""

# PYTHON_ARGCOMPLETE_OK

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Sequence
from contextlib import ExitStack, nullcontext, redirect_stderr, redirect_stdout
from pathlib import Path

from fcsim.command_line import info, render, run, solve, solvers, sweep
from fcsim.command_line.answers import answering
from fcsim.command_line.assignments import number, whole_number
from fcsim.command_line.masonry import atlas, structures
from fcsim.command_line.sets import bench, collection, leaderboard, profile
from fcsim.command_line.start import begin, cases, completion, doctor
from fcsim.command_line.terminal import any_encoding, one_line, open_streams, prints_aside, say, silence, write
from fcsim.errors import EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_OK, FcsimError, InputError
from fcsim.files import refuse_unwritable_place
from fcsim.interrupts import ended_by, ended_politely, is_interrupt
from fcsim.ranks import asked_ranks, end_with, own_rank, sharing
from fcsim.records import json_text
from fcsim.runtime import limited_threads
from fcsim.version import __version__


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsim",
        description="Frictional contact between deformable and rigid bodies: run cases, solve and describe FCLIB problems.",
        epilog="""To begin: fcsim doctor, fcsim cases, fcsim run masonry_wall, fcsim render results/masonry_wall, fcsim new NAME.
Exit codes: 0 all converged, 1 no convergence or penetration seen, 2 bad input, 130 interrupted.""",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"fcsim {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    measuring = (collection, bench, profile, leaderboard)
    for command in (cases, begin, doctor, run, sweep, solve, info, render, solvers, *measuring, structures, atlas, completion):
        command.add_parser(commands)
    _add_output_options(parser)
    return parser


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    """Give every command --quiet, and --json where it has none of its own; and have numbers that are none refused by what was expected."""
    parsers = [parser]
    for parent in parsers:
        below = [action for action in parent._actions if isinstance(action, argparse._SubParsersAction)]
        for action in parent._actions:
            if action.type in (int, float):
                action.type = whole_number if action.type is int else number
        for action in below:
            parsers += list(dict.fromkeys(action.choices.values()))
        if parent is parser or not below:
            parent.add_argument("--quiet", action="store_true", default=argparse.SUPPRESS, help="say nothing but errors")
        if not below and "--json" not in parent._option_string_actions:
            parent.add_argument("--json", action="store_true", dest="as_json", help="print the answer as JSON")


RESULTS = ("out", "page", "export", "draw")
"""Options that say where results go."""


def _refuse_unwritable(options: argparse.Namespace) -> None:
    """InputError where results cannot be written to where they are to go: before they are computed, not after. A run looks itself."""
    if options.command not in SHARED:
        for name in RESULTS:
            if isinstance(place := getattr(options, name, None), Path):
                refuse_unwritable_place(place)


SHARED = ("run",)
"""Commands whose work the ranks of MPI share."""


def _refuse_ranks(command: str, launcher: str | None) -> None:
    """InputError where there are several ranks for what is one process' work."""
    if _for_one(command, launcher):
        raise InputError(
            f"fcsim {command}: expected one process, got {asked_ranks()} ranks of MPI, which share the work of fcsim run alone"
        )


def _for_one(command: str, launcher: str | None) -> bool:
    """Whether each of several ranks would do the whole work of the command, into one folder; but for a run, and for a bench whose launcher
    shares its measurements among the ranks."""
    return launcher != "mpi" and command not in SHARED and asked_ranks() > 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    open_streams()
    any_encoding()
    parser = _parser()
    completion.complete(parser)
    with ExitStack() as stack:
        if own_rank():  # of None argparse makes standard output
            stack.enter_context(redirect_stderr(unread := io.StringIO()))
            stack.enter_context(redirect_stdout(unread))
        options = parser.parse_args(arguments)
    launcher = getattr(options, "launcher", None)
    listens = own_rank() > 0 and (options.command in SHARED or _for_one(options.command, launcher))  # rank 0 speaks for all
    if listens:
        silence(sys.stdout)
    with answering(quiet=listens or getattr(options, "quiet", False), as_json=getattr(options, "as_json", False)) as answer:
        with nullcontext() if answer.document is None else prints_aside():
            code, message = _acted(options)
        end_with(code)
        if message and not listens:
            say(f"fcsim: {one_line(message)}", to_stderr=True)
        about = {"command": options.command, "exit_code": code, **({"error": message} if message else {})}
        if answer.document is not None:
            write(json_text({**about, **answer.whole()}).rstrip())
        elif message and getattr(options, "json", False) and not (answer.silent or answer.spoken):  # a command with an answer of its own
            write(json_text(about).rstrip())
        if answer.lost:  # what is kept of the answer is not the answer: no success, though the work is done
            say(f"fcsim: standard output: {answer.lost}; the answer there is not whole", to_stderr=True)
            code = code or EXIT_BAD_INPUT
    return code


def _acted(options: argparse.Namespace) -> tuple[int, str]:
    """The exit code of a command, and the message of what ended it."""
    try:
        _refuse_ranks(options.command, getattr(options, "launcher", None))
        _refuse_unwritable(options)
        with sharing() if options.command in SHARED else nullcontext(), limited_threads(), ended_politely():
            return int(options.act(options)), ""
    except FcsimError as error:
        return EXIT_BAD_INPUT, str(error)
    except SystemExit as error:  # of a case's sensor: the run has failed, whatever it says
        return EXIT_BAD_INPUT, f"a script ended the program (SystemExit: {error})"
    except BrokenPipeError:  # the reader of our output left, as `head` does
        silence(sys.stdout)
        return EXIT_OK, ""
    except (FileExistsError, NotADirectoryError) as error:
        return EXIT_BAD_INPUT, f"{error.filename}: expected a folder to write into, found a file there or above it"
    except PermissionError as error:
        what = f"{error.filename}: " if error.filename else ""
        return EXIT_BAD_INPUT, f"{what}expected a place that this user may read and write, got: {error.strerror or error}"
    except OSError as error:  # a full disk
        if error.filename is None and _nowhere():
            return EXIT_BAD_INPUT, "the working directory is no longer there: go to another folder"
        name = error.filename2 or error.filename  # of a copy the file that was written
        return EXIT_BAD_INPUT, f"{name}: {error.strerror}" if name and error.strerror else str(error)
    except MemoryError as error:
        return (
            EXIT_BAD_INPUT,
            f"memory: expected more of it than is free{f' ({error})' if str(error) else ''}; ask for less, or fewer steps",
        )
    except (KeyboardInterrupt, SystemError) as error:
        if not is_interrupt(error):
            raise
        return EXIT_INTERRUPTED, f"interrupted by {ended_by(error)}"


def _nowhere() -> bool:
    """Whether the folder in which the command was given has been removed meanwhile, which the system's error does not say."""
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


if __name__ == "__main__":
    raise SystemExit(main())
