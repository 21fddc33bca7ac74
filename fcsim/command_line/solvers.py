"""fcsim solvers: the table of solvers with their options."""

from __future__ import annotations

import argparse
import dataclasses
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING

from fcsim.command_line.answers import answer
from fcsim.command_line.assignments import add_plugin_option
from fcsim.command_line.terminal import say, table_lines
from fcsim.errors import EXIT_OK

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `solvers`."""
    solvers = commands.add_parser("solvers", help="list the solvers", description="Print the table of solvers.")
    add_plugin_option(solvers)
    solvers.set_defaults(act=_solvers)


def _solvers(options: argparse.Namespace) -> int:
    from fcsim.solvers import ALIASES, SOLVERS
    from fcsim.solvers.plugins import load_plugins

    load_plugins(options.plugin)
    table = [
        {
            "name": name,
            "family": m.family,
            "dimensions": m.dimensions,
            "source": m.source,
            "options": _described(m.options),
            "limits": m.limits,
        }
        for name, m in SOLVERS.items()
    ]
    if answer({"solvers": table, "aliases": ALIASES}):
        return EXIT_OK
    rows = [(name, m.family, ",".join(map(str, m.dimensions)), m.source) for name, m in SOLVERS.items()]
    lines = table_lines(("name", "family", "dim", "source"), rows, texts=4)
    say(lines[0])
    for line, (name, method) in zip(lines[1:], SOLVERS.items(), strict=True):
        say(line)
        aliases = ", ".join(alias for alias, meant in ALIASES.items() if meant == name and alias not in SOLVERS)
        described = f"alias: {aliases}; " if aliases else ""
        described += (f"Siconos: {method.siconos}; " if method.siconos else "") + _described(method.options)
        described += f"; limits: {method.limits}" if method.limits else ""
        say(textwrap.fill(described, 132, initial_indent="    ", subsequent_indent="    "))
    say("options with their defaults, changed by --set NAME=VALUE")
    return EXIT_OK


def _described(options: DataclassInstance) -> str:
    """A method's options and their defaults in one line; a hybrid's stages by their functions."""
    texts = []
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if field.name in ("first", "stages"):
            value = " then ".join(f"{stage.options.max_iterations} {stage.run.__name__}" for stage in value) or "none"
        elif isinstance(value, Mapping):
            value = ", ".join(f"{key} {entry}" for key, entry in value.items()) or "none"
        texts.append(f"{field.name}={value:.6g}" if isinstance(value, float) else f"{field.name}={value}")
    return "; ".join(texts)
