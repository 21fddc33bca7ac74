"""fcsim info: what an FCLIB file holds, and how good its stored solution is; what a model of blocks is."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.answers import answer
from fcsim.command_line.terminal import say
from fcsim.errors import EXIT_OK, InputError

if TYPE_CHECKING:
    from fcsim.export_fclib import Solution
    from fcsim.masonry import MasonryProblem

OFF = 1e-6
"""Of |q|: a stored u may differ by so much from that which the stored r has by the problem's equations."""
MODELS = (".json", ".stl", ".obj", ".ply", ".off", ".3mf", ".glb", ".msh", ".vtu", ".vtk", ".xdmf", ".inp", ".mesh", ".med")


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `info`."""
    info = commands.add_parser(
        "info",
        help="describe an FCLIB file or a model of blocks",
        description="Print what an FCLIB file holds, or what a model of blocks is: a masonry problem or COMPAS JSON, solids, a mesh.",
    )
    info.add_argument("file", type=Path, metavar="FILE", help="FCLIB file (.hdf5), or a model of blocks")
    info.add_argument("--draw", type=Path, metavar="PICTURE", help="draw a model of blocks into this .png, .jpg, .svg or .pdf")
    info.add_argument("--scale", type=float, help="metres to a unit of length of surface, mesh and COMPAS files: 1e-3 for mm")
    info.add_argument("--array", metavar="NAME", help="of whole numbers of a mesh's cells that are its blocks (default: its groups)")
    info.set_defaults(act=_info)


def _info(options: argparse.Namespace) -> int:
    if options.file.suffix.lower() in MODELS:
        return _model(options)
    for name in ("draw", "scale", "array"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name}: expected it with a model of blocks ({', '.join(MODELS)}), got {options.file}")
    return _fclib(options)


def _model(options: argparse.Namespace) -> int:
    import numpy as np

    from fcsim.masonry import read_model

    if options.draw is not None:
        from fcsim.view.style import refuse_picture

        refuse_picture(options.draw)
    problem = read_model(options.file, scale=options.scale, array=options.array)
    free = [block for block in problem.blocks if not block.support]
    volumes = np.array([block.surface.moments()[0] for block in free])
    masses = np.array([block.mass or (block.density or 0.0) * volume for block, volume in zip(free, volumes, strict=True)])
    points = np.concatenate([block.surface.points for block in free])
    held = [block.name for block in problem.blocks if block.support]
    answer({"file": options.file, "dimension": problem.dimension, "title": problem.title, "blocks": len(free), "held": held})
    answer({"volume [m^3]": volumes.sum(), "mass [kg]": masses.sum(), "smallest [m]": problem.smallest, "mu": problem.mu})
    answer({"loads": problem.loads, "expected": problem.expected})
    say(f"{options.file}: model of blocks in {problem.dimension}D{f', {problem.title}' if problem.title else ''}")
    if problem.question:
        say(f"  question     {problem.question}")
    say(f"  blocks       {len(free)} free, {len(held)} held ({', '.join(held[:6])}{', ...' if len(held) > 6 else ''})")
    say(f"  extent       {' x '.join(f'{x:.4g}' for x in np.ptp(points, axis=0))} m; smallest block {problem.smallest:.4g} m")
    say(f"  volume       {volumes.sum():.6g} m^3, the smallest block {volumes.min():.3g}")
    say(f"  mass         {masses.sum():.6g} kg; density from {(masses / volumes).min():g} to {(masses / volumes).max():g} kg/m^3")
    frictions = [problem.mu, *problem.between.values()]
    say(f"  friction     mu {problem.mu:g}" + (f", of pairs from {min(frictions):g} to {max(frictions):g}" if problem.between else ""))
    for load in problem.loads:
        of = getattr(load, "block", None)
        unit, on = ("m/s^2", "all blocks") if of is None else ("N", f"block {of}")
        growing = ", times the multiplier" if load.scaled else ""
        say(f"  load         ({', '.join(f'{c:g}' for c in load.value)}) {unit} on {on}{growing}")
    if meshed := sum(0 if block.cells is None else len(block.cells.cells) for block in free):
        say(f"  cells        {meshed}, of which blocks are made where they deform")
    say(f"  joints       {_joints(problem)}")
    for expected in problem.expected:
        say(f"  expected     {expected.quantity} {expected.value}" + (f" ({expected.kind})" if expected.kind else ""))
    if options.draw is not None:
        from fcsim.view.blocks import draw_blocks

        say(draw_blocks(problem, options.draw))
    return EXIT_OK


def _joints(problem: MasonryProblem) -> str:
    """How many pairs of blocks touch, and which blocks touch nothing."""
    from dataclasses import replace

    import numpy as np

    from fcsim.masonry import limit_problem

    try:
        pairs = limit_problem(replace(problem, shaking=())).contacts.bodies
    except InputError as error:  # blocks that overlap: a description says so, an analysis refuses
        return str(error)
    alone = [block.name for k, block in enumerate(problem.blocks) if not block.support and not np.any(pairs == k)]
    lonely = f"; nothing touches {', '.join(alone[:6])}{', ...' if len(alone) > 6 else ''}" if alone else ""
    return f"{len(np.unique(np.sort(pairs, axis=1), axis=0))} in {len(pairs)} contacts{lonely}"


def _fclib(options: argparse.Namespace) -> int:
    import numpy as np

    from fcsim.export_fclib import odd_matrices, read_fclib
    from fcsim.problem import LocalProblem

    content = read_fclib(options.file)
    problem = content.problem
    answer({"file": options.file, "form": content.form, "nc": problem.nc, "m": problem.m, "n": getattr(problem, "n", None)})
    answer({"dimension": getattr(problem, "dimension", 5), "guesses": len(content.guesses), "solution": None})
    answer({"mu": [problem.mu.min(), problem.mu.max()] if problem.nc else None, "matrices": content.matrices})
    say(f"{options.file}: FCLIB {content.form.replace('_', ' ')} problem")
    for name in ("title", "description", "math_info"):
        if getattr(content.info, name):
            say(f"  {name:12s} {getattr(content.info, name)}")
    unknowns = f"{problem.m} local unknowns"
    density = ""
    if not isinstance(problem, LocalProblem):
        unknowns += f", {problem.n} degrees of freedom"
        density = f", contact density m/n = {problem.m / problem.n:.4g}" if problem.n else ""
    say(f"  contacts     {problem.nc} in {getattr(problem, 'dimension', 5)}D: {unknowns}{density}")
    if problem.nc:
        say(f"  friction     mu from {problem.mu.min():g} to {problem.mu.max():g}")
    for letter, matrix in content.matrices.items():
        known = {name: getattr(matrix, name) for name in ("conditioning", "determinant", "rank")}
        more = [f"{name} {value:g}" for name, value in known.items() if value is not None] + ([matrix.comment] if matrix.comment else [])
        shape = " x ".join(map(str, matrix.shape))
        say(f"  {letter:12s} {shape}, {matrix.nnz} entries stored as {matrix.storage}" + (f"; {', '.join(more)}" if more else ""))
    vector = "q" if isinstance(problem, LocalProblem) else "f"
    with np.errstate(over="ignore"):  # of numbers whose squares no float holds: scaled, and inf where no float holds the norm either
        most = float(np.abs(values := getattr(problem, vector)).max(initial=0.0))
        say(f"  |{vector}|          {most * float(np.linalg.norm(values / (most or 1.0))):.6g}")
    if content.solution is not None:
        say(f"  solution     stored{_judged(problem, content.solution)}")
    if content.guesses:
        say(f"  guesses      {len(content.guesses)}")
    for remark in odd_matrices(problem):
        say(f"  note: {remark}")
    return EXIT_OK


def _judged(problem: object, solution: Solution) -> str:
    """The errors of a stored solution, and whether its u is that of its r, as what is said of it; nothing of problems without an error."""
    import numpy as np

    from fcsim.problem import GlobalProblem, Judge, LocalProblem
    from fcsim.problem.rolling import GlobalRollingProblem
    from fcsim.solvers.solve_rolling import rolling_errors

    off = 0.0
    if isinstance(problem, GlobalProblem | LocalProblem):
        judge = Judge(problem)
        scaled, published = judge.scaled_error(solution.r), judge.error(solution.r)
        off = float(np.linalg.norm(solution.u - judge.velocity(solution.r))) / (judge.scale or 1.0)
    elif isinstance(problem, GlobalRollingProblem):
        scaled, published = rolling_errors(problem, solution.r)
    else:
        return ""
    answer({"solution": {"scaled_error": scaled, "published_error": published}})
    another = "" if off <= OFF else f"; the stored u is another one than that of the stored r, by {off:.1e} |q|"
    return f", error {scaled:.3e} (published: {published:.3e}){another}"
