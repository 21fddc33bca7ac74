"""What several commands take: --set NAME=VALUE, tolerances, limits, plugins, jobs of a cluster."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.errors import InputError

if TYPE_CHECKING:
    from fcsim.cluster import Cluster
    from fcsim.running.case import CaseScript


def read_assignments(texts: Sequence[str]) -> dict[str, str]:
    """The values by name, as texts. Raises InputError where one is no NAME=VALUE, or a name is given two values."""
    assignments: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name, value = name.strip(), value.strip()
        if not equals or not name:
            raise InputError(f"--set {text}: expected NAME=VALUE")
        if assignments.setdefault(name, value) != value:
            raise InputError(f"--set {text}: expected one value of {name}, got {assignments[name]} before")
    return assignments


def given_by_options(options: argparse.Namespace, script: CaseScript) -> dict[str, str]:
    """The parameters that --steps, --solver and --tol set, as texts. InputError where the case has none of that name."""
    given = {name: str(value) for name in ("steps", "solver", "tol") if (value := getattr(options, name)) is not None}
    known = [field.name for field in dataclasses.fields(script.parameters)]
    for name, text in given.items():
        if name not in known:
            raise InputError(
                f"--{name} {text}: case {script.name} has no parameter {name} that it could set, but {', '.join(known)}; give its "
                f"Parameters a field {name} that build uses, or change it in the script"
            )
    return given


def whole_number(text: str) -> int:
    """The type of options: argparse's own words for what is none are "invalid int value"."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a whole number, such as 1000, got {text!r}") from None


def number(text: str) -> float:
    """See `whole_number`."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, such as 1e-8, got {text!r}") from None


def checked_tolerance(tol: float) -> float:
    """A tolerance on the relative error. From 1 on r = 0 would always do, without an iteration."""
    if not 0 < tol < 1:
        raise InputError(f"--tol: expected a number between 0 and 1, got {tol:g}")
    return tol


def positive(option: str, value: float, *, infinite: bool = False) -> float:
    """A number above 0, finite unless it may be infinite."""
    if not (value > 0 and (infinite or math.isfinite(value))):
        raise InputError(f"{option}: expected a number > 0, got {value:g}")
    return value


def add_plugin_option(parser: argparse.ArgumentParser) -> None:
    """Add --plugin FILE, which `fcsim.solvers.plugins.load_plugins` takes."""
    parser.add_argument("--plugin", type=Path, action="append", default=[], metavar="FILE", help="Python file that adds to SOLVERS")


LAUNCHERS = ("local", "slurm", "jobs")


def add_launcher(parser: argparse.ArgumentParser, text: str, choices: Sequence[str] = LAUNCHERS) -> None:
    """Add --launcher and --cluster-option, which `cluster_of` reads."""
    parser.add_argument("--launcher", choices=choices, default="local", help=f"{text} (default local)")
    parser.add_argument("--cluster-option", action="append", default=[], metavar="NAME=VALUE", help="of Slurm: partition=..., account=...")


def cluster_of(options: argparse.Namespace, *, seconds: float | None, at_once: int, threads: int, memory: float | None) -> Cluster | None:
    """Where jobs are made, None for processes of this machine; seconds [s] and memory [MiB] of a job. InputError where something lacks."""
    if options.cluster_option and options.launcher != "slurm":
        raise InputError(f"--cluster-option {options.cluster_option[0]}: expected --launcher slurm beside it, got {options.launcher}")
    if options.launcher not in ("slurm", "jobs"):
        return None
    if seconds is None:
        raise InputError(f"--launcher {options.launcher}: expected --time-limit SECONDS, which a job of a cluster needs")
    from fcsim.cluster import Cluster

    return Cluster(options.launcher, seconds, at_once, threads, memory, read_assignments(options.cluster_option))
