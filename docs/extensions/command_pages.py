"""The page of the command line: what each command's `--help` prints, from the parser itself."""

import argparse
import os

os.environ.setdefault("COLUMNS", "110")
os.environ.setdefault("NO_COLOR", "1")


def _commands(parser, name):
    yield name, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            seen = set()
            for word, sub in action.choices.items():
                if id(sub) not in seen:
                    seen.add(id(sub))
                    yield from _commands(sub, f"{name} {word}")


def page():
    """The page as Markdown."""
    from fcsim.command_line.main import _parser

    lines = ["# The command line", "", "What `fcsim COMMAND --help` prints.", ""]
    for name, parser in _commands(_parser(), "fcsim"):
        lines += [f"## {name}", "", "```text", parser.format_help().rstrip().replace("\u001b", ""), "```", ""]
    return "\n".join(lines)
