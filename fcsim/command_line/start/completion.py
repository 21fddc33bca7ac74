"""fcsim completion: what a shell needs to complete fcsim's commands, options, cases, parameters and solvers."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from fcsim.command_line.answers import answer
from fcsim.command_line.terminal import write
from fcsim.errors import EXIT_OK, MissingDependency

SHELLS = ("bash", "zsh", "fish")
SOLVERS = ("--solver", "--solvers", "--reference")
"""Options whose values are names of solvers."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `completion`."""
    completion = commands.add_parser(
        "completion",
        help="print what lets a shell complete fcsim's words",
        description="Print the code that lets a shell complete commands, options, cases, parameters after --set and solvers: "
        'bash, zsh: eval "$(fcsim completion bash)"; fish: fcsim completion fish | source. Put that line into ~/.bashrc, ~/.zshrc or '
        "~/.config/fish/config.fish.",
    )
    completion.add_argument("shell", choices=SHELLS, help="which shell reads the code")
    completion.set_defaults(act=_completion)


def _completion(options: argparse.Namespace) -> int:
    try:
        from argcomplete.shell_integration import shellcode
    except ImportError:
        raise MissingDependency("completion needs argcomplete: pip install 'fcsim[all]', or pip install argcomplete") from None
    code = shellcode(["fcsim"], shell=options.shell)
    if not answer({"shell": options.shell, "code": code}):
        write(code)
    return EXIT_OK


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks for completions, and end; nothing where none asks, or argcomplete is absent."""
    if "_ARGCOMPLETE" not in os.environ:
        return
    try:
        import argcomplete
    except ImportError:
        return
    _add_completers(parser)
    argcomplete.autocomplete(parser)


def _add_completers(parser: argparse.ArgumentParser) -> None:
    """Give arguments that are names of cases, solvers or parameters what completes them."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _add_completers(command)
        elif action.dest in ("case", "source") and not action.option_strings:
            action.completer = _cases  # type: ignore[attr-defined] # argcomplete reads it, argparse does not know it
        elif set(SOLVERS) & set(action.option_strings):
            action.completer = _solvers  # type: ignore[attr-defined] # likewise
        elif {"--set", "--over"} & set(action.option_strings):
            action.completer = _assignments  # type: ignore[attr-defined] # likewise


def _cases(prefix: str, **_: object) -> list[str]:
    """Names of known cases, and paths."""
    from argcomplete.completers import FilesCompleter

    from fcsim.running.known_cases import known_cases

    return [case.name for case in known_cases() if case.name.startswith(prefix)] + list(FilesCompleter()(prefix))


def _solvers(prefix: str, **_: object) -> list[str]:
    """Names of solvers; after commas of --solvers the last one."""
    from fcsim.solvers import SOLVERS as TABLE

    before, comma, _last = prefix.rpartition(",")
    return [before + comma + name for name in ["auto", *TABLE] if (before + comma + name).startswith(prefix)]


def _assignments(prefix: str, parsed_args: argparse.Namespace, **_: object) -> list[str]:
    """NAME= of the case's parameters that is given on the line, NAME=VALUE where the values are few; a solver's options for `solve`."""
    case = getattr(parsed_args, "case", None) or getattr(parsed_args, "source", None)
    if case is None:
        return _solver_options(getattr(parsed_args, "solver", None) or "auto")
    from fcsim.running.known_cases import case_place, declared_parameters

    folder = case_place(case)
    parameters = declared_parameters(folder / f"{Path(folder).resolve().name}.py" if folder.is_dir() else folder)
    name, equals, _value = prefix.partition("=")
    if equals:
        return [f"{p.name}={choice}" for p in parameters if p.name == name for choice in p.choices]
    return [f"{p.name}=" for p in parameters]


def _solver_options(solver: str) -> list[str]:
    import dataclasses

    from fcsim.solvers import method

    return [f"{option.name}=" for option in dataclasses.fields(method(solver).options)]
