"""Milliseconds of contact detection and of the contact matrix on the masonry wall, by rule: python benchmarks/detection.py

The joints' candidates change, the platens' stay nodes. Positions: as built, where meshes match to round-off, and with every node
moved by up to 1 µm, so that each facet overlaps its neighbours' opposites by a sliver.
"""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import get_args

import numpy as np

from fcsim.contact_detection import contact_matrix
from fcsim.contact_detection.surfaces.surface import CandidateRule
from fcsim.running.case import load_case

REPEAT = 20


def measure(rule: str) -> list[tuple[int, int, float, float]]:
    """Contacts, nodes a contact, ms of detection and ms of H, for both positions: the best of REPEAT."""
    script = load_case(Path(__file__).parents[1] / "cases" / "masonry_wall")
    simulation = script.build(script.parameters(candidates=rule)).simulation
    x, rows = simulation.model.reference, []
    for positions in (x, x + 1e-6 * np.random.default_rng(0).uniform(-1, 1, x.shape)):
        times = []
        for _ in range(REPEAT):
            begin = perf_counter()
            contacts = simulation.detector(positions)
            middle = perf_counter()
            contact_matrix(contacts, len(x))
            times.append((middle - begin, perf_counter() - middle))
        detection, matrix = 1e3 * np.min(times, axis=0)
        rows.append((len(contacts), contacts.nodes.shape[1], float(detection), float(matrix)))
    return rows


if __name__ == "__main__":
    print("| candidates | contacts, built / moved | nodes a contact | detection [ms] | H [ms] |\n|---|---:|---:|---:|---:|")
    for name in get_args(CandidateRule):
        built, moved = measure(name)
        columns = [
            f"{built[0]} / {moved[0]}",
            f"{built[1]} / {moved[1]}",
            f"{built[2]:.1f} / {moved[2]:.1f}",
            f"{built[3]:.1f} / {moved[3]:.1f}",
        ]
        print(f"| {name} | " + " | ".join(columns) + " |")
