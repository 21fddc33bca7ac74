"""What the commands of masonry share: the file of blocks, directions, how blocks deform, files of blocks that they write."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.errors import InputError

if TYPE_CHECKING:
    from fcsim.masonry import MasonryProblem
    from fcsim.masonry.models import ModelOptions
    from fcsim.masonry.structure import Stone

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def add_model(command: argparse.ArgumentParser) -> None:
    """The file of blocks, and what it may not say itself."""
    command.add_argument(
        "model",
        type=Path,
        help="a masonry problem or COMPAS model in JSON, solids (.stl, .obj, .ply, .off, .3mf, .glb), or a mesh (.msh, .vtu, "
        ".vtk, .xdmf, .inp, .mesh, .med) whose groups are blocks",
    )
    command.add_argument("--density", type=float, help="[kg/m^3] of blocks whose file has none (default 2000)")
    command.add_argument("--scale", type=float, help="metres to a unit of length of surface, mesh and COMPAS files: 1e-3 for mm")
    command.add_argument("--array", metavar="NAME", help="of whole numbers of a mesh's cells that are its blocks (default: its groups)")
    command.add_argument("--support", action="append", default=[], metavar="NAME", help="solid that is held (default: a floor)")
    command.add_argument("--mu", type=float, help="friction coefficient of all joints, in place of the problem's")


def direction(text: str) -> tuple[float, float, float]:
    """The vector that a text says: an axis, its opposite, or three numbers."""
    sign, name = (-1.0, text[1:]) if text.startswith("-") else (1.0, text)
    try:
        values = [sign * c for c in AXES[name]] if name in AXES else [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3 or not all(map(math.isfinite, values)) or not any(values):
        raise argparse.ArgumentTypeError(f"expected x, y, z, -x, -y, -z or three numbers 1,0.5,0, got {text!r}")
    return values[0], values[1], values[2]


def read(options: argparse.Namespace) -> MasonryProblem:
    """The problem of the file that the options name."""
    from fcsim.masonry import read_model

    return read_model(options.model, mu=options.mu, **model_options(options))


def model_options(options: argparse.Namespace) -> ModelOptions:
    """What `add_model` asks besides the file and mu."""
    return {"density": options.density, "scale": options.scale, "supports": options.support, "array": options.array}


def add_stone(command: argparse.ArgumentParser) -> None:
    """Whether blocks deform, and what they are made of."""
    command.add_argument("--blocks", choices=("rigid", "deformable", "mixed"), default="rigid", help="in simulation (default rigid)")
    command.add_argument("--E", type=float, help="[Pa] Young's modulus of deformable blocks (default 1e10)")
    command.add_argument("--nu", type=float, help="Poisson's ratio of deformable blocks (default 0.2)")
    command.add_argument("--cells", type=float, help="size of their cells as a share of a block's smallest edge (default 1)")


def stone(options: argparse.Namespace) -> Stone | None:
    """What deformable blocks are made of; None of rigid ones, for which nothing of it may be said."""
    from fcsim.masonry.structure import Stone

    given = {name: getattr(options, name) for name in ("E", "nu", "cells") if getattr(options, name) is not None}
    if options.blocks == "rigid":
        if given:
            raise InputError(f"--{next(iter(given))}: expected it with --blocks deformable or mixed")
        return None
    for name, value in given.items():
        if name == "nu" and not 0 <= value < 0.5:
            raise InputError(f"--nu: expected a number >= 0 and < 0.5, got {value}")
        if name != "nu" and not (math.isfinite(value) and value > 0):
            raise InputError(f"--{name}: expected a number > 0, got {value}")
    return Stone(**{"cells": 1.0, **given})


def add_export(command: argparse.ArgumentParser, what: str) -> None:
    """`--export FILE`, whose suffix says the format; what: what is written, for the help."""
    command.add_argument(
        "--export", type=Path, metavar="FILE", help=f"{what}: .obj, .stl, .ply, .off, .glb, .3mf, .dxf, .json (a problem), .compas.json"
    )
