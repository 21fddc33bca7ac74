"""Arrays of VTK files carry their unit in their name, "displacement [m]": ParaView shows it beside the colours."""

from __future__ import annotations

UNITS = {
    "displacement": "m",
    "velocity": "m/s",
    "von_mises": "Pa",
    "round_off_of_stress": "Pa",
    "back_stress": "Pa",
    "reaction": "N",
    "reaction_normal": "N",
    "reaction_tangential": "N",
    "force": "N",
    "gap": "m",
    "opening": "m",
    "sliding_velocity": "m/s",
    "rolling_moment": "N m",
    "spinning_moment": "N m",
    "gravity": "m/s^2",
    "overlap": "m",
    "overlap_place": "m",
    "TimeValue": "",  # by which readers know the time
}
"""Of the arrays that have one; what a material or a law of yours remembers is written by its name alone."""


def with_unit(name: str) -> str:
    """The name of an array in a file: "gap" -> "gap [m]"; as it is where it has no unit."""
    return f"{name} [{unit}]" if (unit := UNITS.get(name)) else name


def without_unit(name: str) -> str:
    """The name of an array whose name in a file is given, with or, from runs of fcsim 0.2, without unit."""
    plain, _, unit = name.partition(" [")
    return plain if unit == f"{UNITS.get(plain)}]" else name
