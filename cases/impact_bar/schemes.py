"""The impacting bar by several time schemes and contact laws: a table on the terminal and a picture of forces and energies.

python cases/impact_bar/schemes.py schemes.png [elements]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from impact_bar import ExactSolution, Parameters, build

from fcsim import Step
from fcsim.view.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RED, STYLE, figure, matplotlib, save

VARIANTS = {
    "theta 1/2, gap": {"scheme": "theta", "law": "gap"},
    "theta 1/2, velocity e = 0": {"scheme": "theta", "law": "velocity"},
    "theta 1/2, velocity e = 1": {"scheme": "theta", "law": "velocity", "restitution": 1.0},
    "theta 1, gap": {"scheme": "theta", "theta": 1.0, "law": "gap"},
    "alpha, rho 0.5, gap": {"scheme": "generalised-alpha", "rho": 0.5, "law": "gap"},
    "alpha, rho 0, velocity e = 0": {"scheme": "generalised-alpha", "rho": 0.0, "law": "velocity"},
}


def main(picture: Path, elements: int) -> None:
    base = replace(Parameters(), elements=elements)
    exact = ExactSolution(base)
    runs: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    inside = exact.start + np.array([0.1, 0.9]) * (exact.end - exact.start)
    print(f"{'':28s} start   end   mean force  std  largest  leaves with  energy kept  bounces")
    print(f"{'exact':28s} {1e6 * exact.start:5.2f} {1e6 * exact.end:6.2f}   1.0000   0.000   1.00    {-base.speed:8.2f}    1.0000        1")
    for name, change in VARIANTS.items():
        case = build(replace(base, **change))  # type: ignore[arg-type]
        steps: list[Step] = list(case.simulation)
        measured = {sensor.column: np.array([sensor.measure(step) for step in steps]) for sensor in case.sensors}
        t = np.array([step.state.t for step in steps])
        force = measured["force"] / exact.force_in_contact
        energy = np.array([step.energy.kinetic + step.energy.elastic for step in steps]) / exact.impact_energy
        runs[name] = t, force, energy
        closed = force > 0.02
        during = force[(t > inside[0]) & (t < inside[1])]
        bounces = np.count_nonzero(np.diff(closed.astype(int)) == 1)
        print(
            f"{name:28s} {1e6 * t[closed][0]:5.2f} {1e6 * t[closed][-1]:6.2f}   {during.mean():.4f}   {during.std():.3f}   "
            f"{force.max():.2f}    {measured['velocity'][-1]:8.2f}    {energy[-1]:.4f}     {bounces:4d}"
        )
    draw(picture, exact, runs)


def draw(path: Path, exact: ExactSolution, runs: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
    """One panel of force a variant, and one of the energies of all."""
    with matplotlib().rc_context({**STYLE, "savefig.dpi": 80, "font.size": 10.0}):
        drawing = figure(12.0, 9.0, layout="constrained")
        grid = drawing.add_gridspec(3, 3)
        places = [grid[row, column] for row in range(2) for column in range(3)]
        colours = (BLUE, GREEN, ORANGE, RED, PURPLE, GREY)
        for place, (name, (t, force, _)), colour in zip(places, runs.items(), colours, strict=True):
            axes = drawing.add_subplot(place)
            axes.plot(1e6 * t, exact.force(t) / exact.force_in_contact, "--", color=BLACK, linewidth=1.0)
            axes.plot(1e6 * t, force, color=colour, linewidth=0.6)
            axes.set(title=name, ylim=(-0.1, max(1.7, 1.05 * force.max())), xlabel="time [µs]", ylabel="force / (ρ c v₀ A)")
        axes = drawing.add_subplot(grid[2, :])
        for (name, (t, _, energy)), colour in zip(runs.items(), colours, strict=True):
            axes.plot(1e6 * t, energy, color=colour, label=name)
        axes.set(xlabel="time [µs]", ylabel="kinetic + elastic / initial", ylim=(None, 1.01))
        axes.legend(loc="lower left", ncols=2)
        save(drawing, path)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) == 3 else 80)
