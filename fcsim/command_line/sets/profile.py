"""fcsim profile and fcsim report: pictures and tables of a bench's results."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.assignments import add_plugin_option, checked_tolerance, positive
from fcsim.command_line.terminal import print_table, say
from fcsim.errors import InputError
from fcsim.files import replacing

if TYPE_CHECKING:
    from fcsim.bench.reporting.comparison import Comparison


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the commands `profile` and `report`."""
    profile = commands.add_parser(
        "profile",
        help="performance profiles of a bench, convergence of problems",
        description="Draw performance profiles (Dolan, Moré 2002) of a bench's results per tolerance, with summary tables; "
        "with --convergence, solve problems and draw the error against time and iterations.",
    )
    profile.add_argument("results", type=Path, nargs="?", metavar="RESULTS", help="results folder of fcsim bench, or its results.csv")
    _selection(profile)
    profile.add_argument("--tau-max", type=float, metavar="TAU", help="end of the tau axis (default: the largest ratio)")
    profile.add_argument("--out", type=Path, metavar="DIR", help="folder of the pictures and tables (default: RESULTS/profiles)")
    profile.add_argument("--convergence", type=Path, nargs="+", default=[], metavar="FILE", help="FCLIB files to solve by --solvers")
    profile.add_argument("--tol", type=float, default=1e-8, help="tolerance of --convergence (default 1e-8)")
    profile.add_argument("--time-limit", type=float, default=100.0, metavar="SECONDS", help="of each solve of --convergence (default 100)")
    add_plugin_option(profile)
    profile.set_defaults(act=_profile)

    report = commands.add_parser(
        "report",
        help="one HTML page of a bench's results",
        description="Write one self-contained HTML page: what was measured, profiles, tables, pictures, how to reproduce it.",
    )
    report.add_argument("results", type=Path, metavar="DIR", help="results folder of fcsim bench")
    _selection(report)
    report.add_argument(
        "--collection", type=Path, action="append", default=[], metavar="DIR", help="folder of the problems; may be repeated"
    )
    report.add_argument("--against", type=Path, metavar="DIR2", help="results of another bench, set beside this one problem by problem")
    report.add_argument("--title", help="title of the page")
    report.add_argument("--out", type=Path, metavar="FILE", help="the page (default: DIR/report.html)")
    report.set_defaults(act=_report)


def _selection(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--tols", type=_numbers, metavar="TOL,...", help="tolerances (default: all that were measured)")
    parser.add_argument("--solvers", type=_names, metavar="NAME,...", help="solvers (default: all that were measured)")
    parser.add_argument("--clock", choices=("wall", "cpu"), default="wall", help="time to compare by (default wall)")
    parser.add_argument("--reference", metavar="SOLVER", help="tabulate how much faster than this solver the others are")
    parser.add_argument("--leave-out-unsolved", action="store_true", help="do not count problems that no solver solved")
    parser.add_argument("--resolution", type=float, default=1e-6, metavar="SECONDS", help="shorter times are ties (default 1e-6)")


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _numbers(text: str) -> list[float]:
    try:
        return [float(name) for name in _names(text)]
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected numbers with commas between, got {text!r}") from None


def _profile(options: argparse.Namespace) -> int:
    from fcsim.solvers.plugins import load_plugins

    load_plugins(options.plugin)
    if options.results is None and not options.convergence:
        raise InputError("fcsim profile: expected RESULTS, the folder of a bench, or --convergence FILE")
    written: list[Path] = []
    if options.results is not None:
        written += _write_profiles(options)
    if options.convergence:
        written += _write_convergence(options)
    for path in written:
        say(path)
    return 0


def _comparison(options: argparse.Namespace) -> Comparison:
    from fcsim.bench.reporting.comparison import Selection, compare

    selection = Selection(**{field.name: getattr(options, field.name) for field in dataclasses.fields(Selection)})
    return compare(options.results, selection)


def _folder(results: Path) -> Path:
    return results if results.is_dir() else results.parent


def _write_profiles(options: argparse.Namespace) -> list[Path]:
    from fcsim.bench.reporting.profile_plots import write_profiles
    from fcsim.bench.reporting.summary import csv_text, markdown

    comparison = _comparison(options)
    directory = options.out or _folder(options.results) / "profiles"
    written = write_profiles(comparison, directory, options.tau_max)
    for name, text in (("summary.md", markdown(comparison.summaries)), ("summary.csv", csv_text(comparison.summaries))):
        with replacing(directory / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
        written.append(directory / name)
    _print_tables(comparison)
    return written


def _print_tables(comparison: Comparison) -> None:
    from fcsim.bench.reporting.summary import tables

    for title, header, rows in tables(comparison.summaries):
        print_table(header, rows, title=title)
    for remark in comparison.remarks:
        say(f"note: {remark}")


def _write_convergence(options: argparse.Namespace) -> list[Path]:
    from fcsim.bench.reporting.convergence import solve_all, write_convergence

    if not options.solvers:
        raise InputError("--convergence: expected --solvers NAME,..., the solvers to draw")
    positive("--time-limit", options.time_limit)
    checked_tolerance(options.tol)
    directory = options.out or (Path("convergence") if options.results is None else _folder(options.results) / "profiles")
    written = []
    for file in options.convergence:
        runs = solve_all(file, options.solvers, tol=options.tol, time_limit=options.time_limit)
        for run in runs:
            say(f"{file.name}, {run.solver}: {run.status}, error {run.error:.1e}, {run.iterations} iterations, {run.seconds:.3g} s")
        written += write_convergence(runs, file.stem, directory, options.tol)
    return written


def _report(options: argparse.Namespace) -> int:
    from fcsim.bench.reporting.report import write_report

    path = options.out or _folder(options.results) / "report.html"
    of = {"results": options.results, "collections": options.collection, "title": options.title, "against": options.against}
    say(write_report(_comparison(options), path, **of))
    return 0
