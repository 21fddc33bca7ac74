"""The errors that fcsim raises on purpose: each message names the file or argument, what was expected and what came."""

from __future__ import annotations

import traceback
from collections.abc import Callable


class FcsimError(Exception):
    """Base of every error that fcsim raises on purpose; the command line prints its message without a traceback."""


class InputError(FcsimError, ValueError):
    """An argument, option or file content that cannot be used."""


class MissingDependency(FcsimError, ImportError):
    """An optional package is not installed; the message says which extra brings it."""


class Unphysical(FcsimError, RuntimeError):
    """A simulation left what its model covers: what followed would be wrong, so it stops there; the message says why and what helps."""


class NotConverged(FcsimError, RuntimeError):
    """A step did not converge, even after the whole fallback chain; the simulation stops there."""


class Penetration(Unphysical):
    """The witness saw bodies overlap by more than it bears; the simulation stops there."""


MODEL = "what build_model(...) returns"
"""What is expected of a model, see `expect`."""


def expect(value: object, kind: type | tuple[type, ...], what: str, expected: str) -> None:
    """InputError where an argument is of none of these kinds: `what` is expected to be `expected`."""
    if not isinstance(value, kind):
        got = repr(value)[:60] if value is None or isinstance(value, str | int | float) else type(value).__name__
        raise InputError(f"{what}: expected {expected}, got {got}")


EXIT_OK, EXIT_NOT_CONVERGED, EXIT_BAD_INPUT, EXIT_INTERRUPTED = 0, 1, 2, 130
"""What the command line returns: all converged or verified, something did not, bad input, interrupted."""


def asked[T](what: str, function: Callable[..., T], *arguments: object) -> T:
    """What a user's function answers; where it raises an InputError that says what it raised and in which line."""
    try:
        return function(*arguments)
    except FcsimError:
        raise
    except Exception as error:  # whatever a user's function raises
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = f" ({frame.filename}, line {frame.lineno})" if frame.name != "asked" else ""
        said = " ".join(str(error).split())
        raise InputError(f"{what}: the function raised {type(error).__name__}{': ' if said else ''}{said}{where}") from error
