"""fcsim leaderboard: families of problems and FCLIB files, fcsim's methods and Siconos', one page."""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import shlex
from collections.abc import Sequence
from datetime import timedelta
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.assignments import LAUNCHERS
from fcsim.command_line.sets.measuring import (
    SICONOS_BEST,
    SICONOS_PYTHON,
    add_measuring,
    check_measuring,
    measured,
    names_in,
    settings_of,
    solvers_of,
    tell_interrupted,
    tolerances_of,
)
from fcsim.command_line.terminal import Bar, print_table, say
from fcsim.errors import EXIT_BAD_INPUT, EXIT_OK, InputError
from fcsim.version import __version__

if TYPE_CHECKING:
    from fcsim.bench.problems import Entry
    from fcsim.bench.reporting.standings import Group
    from fcsim.bench.results import Measurement
    from fcsim.bench.workers.worker import Settings

SOLVERS = "auto,NSN-AC,NSN-AC-HYBRID,NSGS-AC,NSGS-AA,NNCG,PPA-NSN-AC,PROX-NEWTON,LM,ADMM,ADMM-SPECTRAL,EG-VI-UPK"
"""One method or two of each kind that solves most problems of some family."""
PACKAGES = ("numpy", "scipy", "numba", "h5py")
PROBLEMS, PAGE = "problems", "leaderboard.html"

DESCRIPTION = """\
Make problems of the families (FOLDER/problems, the same ones wherever they are made), measure solvers on them and on FCLIB files as fcsim
bench does, and write one page: FOLDER/leaderboard.html, with a table for each family and folder and over all, performance profiles, who
fails on what, versions and the command that repeats it. The tables alone are in FOLDER/leaderboard.md.

FOLDER is one of fcsim bench too: a leaderboard that was ended by whatever goes on when the same command is given again, results.csv has all
figures, and fcsim profile and fcsim report take it. Siconos is measured where --siconos-python has it, and named as absent on the page
where it has not.
"""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `leaderboard`."""
    board = commands.add_parser(
        "leaderboard",
        help="solvers on families of problems and FCLIB files, Siconos beside them: one page",
        description=DESCRIPTION,
        epilog="Exit codes: 0 all measurements are made, whatever they say; 2 bad input; 130 interrupted, the same command goes on.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    board.add_argument(
        "folder", type=Path, nargs="?", default=Path("results/leaderboard"), metavar="FOLDER", help="default results/leaderboard"
    )
    board.add_argument(
        "--fclib", type=Path, action="append", default=[], metavar="DIR", help="a folder of FCLIB files, or such a file; may be repeated"
    )
    board.add_argument("--families", default="all", metavar="all|none|NAME,...", help="of fcsim.bench.families (default all)")
    board.add_argument("--sizes", default="30,100", metavar="NUMBER,...", help="contacts of a problem, about (default 30,100)")
    board.add_argument("--seeds", default="0,1", metavar="NUMBER,...", help="that draw the problems (default 0,1)")
    board.add_argument("--solvers", default=SOLVERS, metavar="all|NAME,...", help=f"see fcsim solvers; default {SOLVERS}")
    board.add_argument(
        "--siconos",
        metavar="none|best|NAME,...",
        help=f"configurations of Siconos; best: {', '.join(SICONOS_BEST)} (default: best, where there is Siconos)",
    )
    board.add_argument("--tols", default="1e-8", metavar="TOL,...", help="default 1e-8")
    board.add_argument("--clock", choices=("wall", "cpu"), default="wall", help="time to compare by; cpu on a busy machine (default wall)")
    add_measuring(board, time_limit=10.0, launchers=LAUNCHERS)
    board.set_defaults(act=_leaderboard)


def _numbers(option: str, text: str, what: str, least: int, most: float = math.inf) -> list[int]:
    try:
        numbers = [int(part) for part in names_in(text)]
    except ValueError:
        raise InputError(f"{option}: expected whole numbers with commas between, got {text!r}") from None
    if not numbers:
        raise InputError(f"{option}: expected at least one whole number, got none")
    if wrong := [number for number in numbers if not least <= number <= most]:
        raise InputError(f"{option}: expected {what}, got {wrong[0]}")
    return numbers


def _families(text: str) -> list[str]:
    from fcsim.bench.families import FAMILIES

    return list(FAMILIES) if text == "all" else [] if text == "none" else names_in(text)


def _solvers(options: argparse.Namespace) -> tuple[list[str], str]:
    """The solvers, and a note where Siconos, not asked for by name, is absent."""
    from fcsim.bench.workers.siconos_client import siconos_version
    from fcsim.solvers import SOLVERS as TABLE

    own = ",".join(TABLE) if options.solvers == "all" else options.solvers
    if options.siconos is not None:
        return solvers_of(own, options.siconos), "Siconos was left out." if options.siconos == "none" else ""
    if siconos_version(options.siconos_python):
        return solvers_of(own, "best"), ""
    return solvers_of(own, "none"), f"Siconos is absent: {options.siconos_python} cannot import siconos.numerics."


def _refuse_foreign(folder: Path) -> None:
    """InputError for a folder of other files, as of FCLIB files that were to be measured on, or of a bench of its own: problems and tables
    would lie among them."""
    from fcsim.bench.families.files import NOTE

    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: expected a folder for the leaderboard, a new one or its own, found a file")
    if not folder.is_dir():
        return
    command = _made_by(folder / "bench.json")
    if command is not None and command[:2] != ["fcsim", "leaderboard"]:
        raise InputError(f"{folder}: expected a folder for the leaderboard, a new one or its own, found a bench ({shlex.join(command)})")
    made = (folder / PROBLEMS / NOTE).is_file()  # by a leaderboard that was interrupted before it measured
    others = sorted(entry.name for entry in folder.iterdir() if not (made and entry.name == PROBLEMS))
    if others and command is None:
        few = ", ".join(others[:3]) + (", ..." if len(others) > 3 else "")
        raise InputError(
            f"{folder}: expected a folder for the leaderboard, a new one or its own, found other files ({few}); files to measure on "
            f"are given by --fclib {shlex.quote(str(folder))}"
        )


def _made_by(note: Path) -> list[str] | None:
    """The words of the command whose results lie beside a bench.json; None without one."""
    if not note.exists():
        return None
    try:
        return shlex.split(json.loads(note.read_text(encoding="utf-8"))["command"])
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{note}: expected the note of fcsim leaderboard on its results, JSON ({error})") from None


def _announce(options: argparse.Namespace, problems: int, solvers: Sequence[str], tols: Sequence[float]) -> None:
    """Say what is about to be done, how long it may take, and where it will be: a bench is long, and begins at once."""
    solves = problems * len(solvers) * len(tols)
    most = timedelta(seconds=round(solves * options.time_limit / options.jobs))
    say(
        f"fcsim leaderboard: {problems} problems x {len(solvers)} solvers x {len(tols)} tolerances, up to {solves} solves of at most "
        f"{options.time_limit:g} s, {most} if all take as long; into {options.folder}; interrupted, the same command goes on",
        to_stderr=True,
    )


def _problems(options: argparse.Namespace) -> tuple[list[Entry], dict[tuple[str, str], tuple[str, str, bool | None]], list[str]]:
    """The problems, the group of each by name and form as `groups` takes it, and notes on what is left out."""
    from fcsim.bench.families import FAMILIES, LARGEST
    from fcsim.bench.families.files import write_problems
    from fcsim.bench.problems import entries

    _refuse_foreign(options.folder)
    families = _families(options.families)
    if not families and not options.fclib:
        raise InputError("--families none: expected --fclib DIR beside it, or families: there are no problems")
    places: dict[Path, tuple[str, str, bool | None]] = {}
    for folder in options.fclib:  # before problems are made, which takes a while
        entries([folder])
        files = sorted(folder.rglob("*.hdf5")) if folder.is_dir() else [folder]
        places |= {file: (f"FCLIB {folder.resolve().stem}", "FCLIB files as they are.", None) for file in files}
    sizes = _numbers("--sizes", options.sizes, f"numbers of contacts from 1 to {LARGEST}", 1, LARGEST)
    seeds = _numbers("--seeds", options.seeds, "integers >= 0", 0)
    with Bar("problems", lines=0) as bar:
        made = write_problems(options.folder / PROBLEMS, families, sizes, seeds, bar.update) if families else {}
    places = {file: (name, FAMILIES[name].about, FAMILIES[name].solvable) for file, name in made.items()} | places
    found, notes = entries([*made, *options.fclib])
    order = {path: place for place, path in enumerate(places)}
    found_in = {(entry.name, entry.form): places[entry.path] for entry in sorted(found, key=lambda entry: order[entry.path])}
    return found, found_in, notes


def command_of(options: argparse.Namespace) -> str:
    """The call that makes the same leaderboard, with what the defaults stand for now."""
    words = ["fcsim", "leaderboard", str(options.folder)]
    for folder in options.fclib:
        words += ["--fclib", str(folder)]
    for name in ("families", "sizes", "seeds", "solvers", "tols", "time_limit"):
        value = getattr(options, name)
        words += ["--" + name.replace("_", "-"), f"{value:g}" if isinstance(value, float) else str(value)]
    if options.siconos is not None:
        words += ["--siconos", options.siconos]
    for name, usual in (
        ("clock", "wall"),
        ("memory_limit", None),
        ("jobs", 1),
        ("threads", 1),
        ("launcher", "local"),
        ("job_time", 7200.0),
    ):
        value = getattr(options, name)
        if value != usual:
            words += ["--" + name.replace("_", "-"), f"{value:g}" if isinstance(value, float) else str(value)]
    if options.siconos_python != SICONOS_PYTHON:
        words += ["--siconos-python", str(options.siconos_python)]
    for name in ("plugin", "cluster_option"):
        for value in getattr(options, name):
            words += ["--" + name.replace("_", "-"), str(value)]
    return shlex.join(words)


def _pairs(options: argparse.Namespace, chosen: Sequence[Measurement], settings: Settings) -> list[tuple[str, str]]:
    """Machine, versions, problems and limits, for the page."""
    from fcsim.bench.reporting.time_table import CLOCKS

    def listed(values: set[str]) -> str:
        return "; ".join(sorted(values))

    versions = [
        f"fcsim {listed({m.version for m in chosen if m.program == 'fcsim'}) or __version__}",
        f"Python {platform.python_version()}",
    ]
    for name in PACKAGES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            versions.append(f"{name}, version unknown")
    theirs = listed({m.version for m in chosen if m.program == "siconos"})
    families = _families(options.families)
    started = sorted(m.started for m in chosen)
    pairs = [
        ("Machine", f"{listed({m.machine for m in chosen})}; {os.cpu_count()} processors, {platform.system()}"),
        ("Load", ", ".join(f"{value:.1f}" for value in os.getloadavg()) + " over 1, 5 and 15 minutes at the end"),
        ("Versions", ", ".join([*versions, f"Siconos {theirs}" if theirs else "no Siconos"])),
        ("Families", f"{', '.join(families)}; sizes {options.sizes}, seeds {options.seeds}" if families else "none"),
        ("FCLIB files", ", ".join(folder.resolve().name for folder in options.fclib) or "none"),
        (
            "Limits",
            f"{options.time_limit:g} s a solve, "
            + ("no limit on memory" if options.memory_limit is None else f"{options.memory_limit:g} MiB"),
        ),
        ("Time", f"{CLOCKS[options.clock][1]}, {settings.threads} thread{'s' * (settings.threads != 1)} a solve, {options.jobs} at a time"),
        ("Measured", f"from {started[0]} to {started[-1]}"),
    ]
    return pairs


def _leaderboard(options: argparse.Namespace) -> int:
    from fcsim.bench.reporting.leaderboard import Circumstances, group_table, heading, write_leaderboard
    from fcsim.bench.reporting.standings import ALL, groups
    from fcsim.bench.results import FILE, read_results
    from fcsim.bench.run import Limits, Plan

    check_measuring(options)
    tols = sorted(set(tolerances_of(options.tols)), reverse=True)
    solvers, absent = _solvers(options)
    settings = settings_of(options, solvers)
    limits = Limits(options.time_limit, options.memory_limit)
    try:
        problems, places, notes = _problems(options)
        _announce(options, len(problems), solvers, tols)
        command = command_of(options)
        progress = measured(options, Plan(problems, solvers, tols, limits, settings), options.folder, {"command": command})
    except KeyboardInterrupt as interrupt:
        return tell_interrupted(options.folder, interrupt)
    assert progress is not None  # no launcher of this command has ranks
    chosen = [m for m in read_results(options.folder) if m.solver in solvers and m.tol in tols and (m.problem, m.form) in places]
    if not chosen:
        raise InputError("; ".join(progress.notes) or f"{options.folder}: no solver of --solvers is made for these problems")
    notes = [note for note in (absent, *notes, *progress.notes) if note]
    about = Circumstances(command, _pairs(options, chosen, settings), notes, solvers[0], options.clock)
    found: dict[float, list[Group]] = {tol: groups(chosen, places, tol) for tol in tols}
    written = write_leaderboard(found, about, options.folder / PAGE, options.folder / FILE)
    for tol, parts in found.items():
        whole = {group.dimension for group in parts if group.name == ALL}
        for group in (g for g in parts if g.name == ALL or g.solvable is False or g.dimension not in whole):
            print_table(*group_table(group, options.clock), title=f"{heading(group)}, {tol:g}")
    for note in notes:
        say(note, to_stderr=True)
    say(f"{progress.measured} measurements made, {progress.done} of {progress.total} in {options.folder / FILE}")
    for path in written:
        say(path)
    return EXIT_BAD_INPUT if progress.notes else EXIT_OK
