"""What deformable blocks are made of, by the options of the masonry commands."""

from argparse import Namespace

import pytest

from fcsim.command_line.masonry.arguments import stone
from fcsim.errors import InputError


def asked(blocks="deformable", **given):
    return stone(Namespace(blocks=blocks, **{"E": None, "nu": None, "cells": None, **given}))


def test_what_is_given_is_taken():
    found = asked(E=2e9, nu=0.0)
    assert (found.E, found.nu, found.cells) == (2e9, 0.0, 1.0)
    assert asked("rigid") is None


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"nu": 0.5}, "--nu: expected a number >= 0 and < 0.5, got 0.5"),
        ({"nu": float("nan")}, "--nu: expected a number >= 0 and < 0.5, got nan"),
        ({"nu": -0.1}, "--nu: expected a number >= 0 and < 0.5, got -0.1"),
        ({"E": 0.0}, "--E: expected a number > 0, got 0.0"),
        ({"cells": float("inf")}, "--cells: expected a number > 0, got inf"),
        ({"blocks": "rigid", "E": 1e9}, "--E: expected it with --blocks deformable or mixed"),
    ],
)
def test_what_cannot_be_meant_is_refused(given, expected):
    with pytest.raises(InputError) as refused:
        asked(**given)
    assert str(refused.value) == expected
