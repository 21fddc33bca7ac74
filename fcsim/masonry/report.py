"""An analysis as files: analysis.json, joints.csv, blocks.csv; a branch as branch.csv, a shaking as shake.csv."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fcsim.files import replacing_for_good
from fcsim.masonry.collapse import Bracket
from fcsim.masonry.histories.branch import Branch
from fcsim.masonry.histories.shake import Shake
from fcsim.masonry.limit_analysis.analysis import LimitAnalysis
from fcsim.masonry.limit_analysis.reactions import SupportForces
from fcsim.masonry.openings import Opening, in_mm
from fcsim.masonry.problem import MasonryProblem
from fcsim.masonry.remarks import remarks
from fcsim.records import write_record
from fcsim.version import __version__


def summary(analysis: LimitAnalysis, seen: Bracket | None) -> Mapping[str, object]:
    """What is known of the collapse load, in JSON's types."""
    found = {
        law: {name: getattr(limit, name) for name in ("outcome", "multiplier", "rounds", "span", "dilatancy")}
        for law, limit in (("associative", analysis.associative), ("coulomb", analysis.coulomb), ("lowest", analysis.lowest))
    }
    simulated = None if seen is None else {"motion": seen.motion, "fall": seen.fall, "trials": seen.trials}
    expected = analysis.problem.expected
    named = {"name": analysis.problem.name, "version": __version__, "limit_analysis": found, "simulation": simulated, "expected": expected}
    return named | {"remarks": remarks(analysis, seen)}


def write_analysis(directory: Path, analysis: LimitAnalysis, seen: Bracket | None) -> None:
    """Write the analysis into a folder: analysis.json, joints.csv (forces, state), blocks.csv (the mechanism's velocities)."""
    directory.mkdir(parents=True, exist_ok=True)
    write_record(directory / "analysis.json", summary(analysis, seen))
    joints = [
        (
            *joint.between,
            joint.state,
            *(f"{1e-3 * value:.6g}" for value in (joint.normal_force, joint.shear_force)),
            f"{joint.used:.6g}",
            f"{joint.eccentricity:.6g}",
            f"{joint.length:.6g}",
        )
        for joint in analysis.joints
    ]
    header = ("block", "with", "state", "N [kN]", "T [kN]", "T/N", "eccentricity [m]", "length [m]")
    write_csv(directory / "joints.csv", header, joints)
    model = analysis.limit.model
    velocities = model.rigid_part(analysis.lowest.v)
    d = model.dimension
    names = ("vx", "vz", "omega") if d == 2 else ("vx", "vy", "vz", "omega x", "omega y", "omega z")
    largest = max(float(np.abs(velocities[:, :d]).max()), 1e-300)
    rows = [(body.name, *(f"{value / largest:.6g}" for value in row)) for body, row in zip(model.rigid, velocities, strict=True)]
    write_csv(directory / "blocks.csv", ("block", *names), rows)


def support_summary(problem: MasonryProblem, multiplier: float, found: Sequence[SupportForces]) -> Mapping[str, object]:
    """What supports may bear, in JSON's types."""
    supports = {f.name: {"least": f.least.tolist(), "largest": f.largest.tolist()} for f in found}
    return {"name": problem.name, "version": __version__, "multiplier": multiplier, "supports [N]": supports}


SUPPORT_COLUMNS = ("support", "along", "least [kN]", "largest [kN]")


def support_rows(found: Sequence[SupportForces], digits: int) -> list[tuple[str, ...]]:
    """A row a component of each support's force, under SUPPORT_COLUMNS."""
    bounds = np.array([[f.least, f.largest] for f in found])
    noise = 1e-11 * np.abs(bounds[np.isfinite(bounds)]).max(initial=0.0)  # [N] below it: round-off of the programs, not a force
    return [
        (f.name, axis, *(f"{0.0 if abs(bound) <= noise else 1e-3 * bound:.{digits}g}" for bound in (low, high)))
        for f in found
        for axis, low, high in zip("xz" if len(f.least) == 2 else "xyz", f.least, f.largest, strict=True)
    ]


def write_supports(directory: Path, found: Sequence[SupportForces]) -> None:
    """Write what supports may bear into a folder: supports.csv."""
    directory.mkdir(parents=True, exist_ok=True)
    write_csv(directory / "supports.csv", SUPPORT_COLUMNS, support_rows(found, digits=9))


def branch_summary(branch: Branch) -> Mapping[str, object]:
    """A push by displacement in JSON's types."""
    curve = {"displacement": branch.displacement.tolist(), "multiplier": branch.multiplier.tolist()}
    return {"version": __version__, "largest": branch.largest, "end": branch.end, "held": branch.held, **curve}


def write_branch(directory: Path, branch: Branch) -> None:
    """Write the curve into a folder: branch.json, branch.csv."""
    directory.mkdir(parents=True, exist_ok=True)
    write_record(directory / "branch.json", branch_summary(branch))
    rows = [(f"{1e3 * d:.9g}", f"{m:.9g}") for d, m in zip(branch.displacement, branch.multiplier, strict=True)]
    write_csv(directory / "branch.csv", ("displacement [mm]", "multiplier"), rows)


def shake_summary(seen: Shake) -> Mapping[str, object]:
    """A shaking in JSON's types."""
    largest = {"displacement": float(seen.displacement.max()), "turn": float(seen.turn.max())}
    end = {"t": float(seen.t[-1]), "displacement": float(seen.displacement[-1]), "turn": float(seen.turn[-1])}
    return {"version": __version__, "largest": largest, "end": end, "fallen": seen.fallen, "moving": seen.moving, "remarks": seen.remarks}


def write_shake(directory: Path, seen: Shake) -> None:
    """Write the histories into a folder: shake.json, shake.csv."""
    directory.mkdir(parents=True, exist_ok=True)
    write_record(directory / "shake.json", shake_summary(seen))
    columns = seen.t, 1e3 * seen.displacement, np.degrees(seen.turn)
    rows = [tuple(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    write_csv(directory / "shake.csv", ("t [s]", "displacement [mm]", "turn [degrees]"), rows)


def write_openings(path: Path, problem: MasonryProblem, joints: tuple[Opening, ...]) -> None:
    """Write the openings of joints, the widest first; what is no more than round-off is 0."""
    rows: list[tuple[str, ...]] = [
        (*joint.between, *(f"{in_mm(value, problem):.6g}" for value in (joint.opening, joint.slip)))
        for joint in sorted(joints, key=lambda joint: -joint.opening)
    ]
    write_csv(path, ("block", "with", "opening [mm]", "slip [mm]"), rows)


def write_csv(path: Path, header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> None:
    """Write a table of texts, whole or not at all."""
    with replacing_for_good(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([header, *rows])
