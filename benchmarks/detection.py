"""Milliseconds of contact detection and of the contact matrix: python benchmarks/detection.py

First the growth of `Everything` with piles of boxes, to 130 000 contacts. Then the masonry wall, by rule. All in processor time.

The joints' candidates change, the platens' stay nodes. Positions: as built, where meshes match to round-off, and with every node
moved by up to 1 µm, so that each facet overlaps its neighbours' opposites by a sliver.
"""

from __future__ import annotations

from pathlib import Path
from time import process_time
from typing import get_args

import numpy as np

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Everything, contact_matrix
from fcsim.contact_detection.surfaces.surface import CandidateRule
from fcsim.mesh.blocks import rigid_box
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
            begin = process_time()
            contacts = simulation.detector(positions)
            middle = process_time()
            contact_matrix(contacts, len(x))
            times.append((middle - begin, process_time() - middle))
        detection, matrix = 1e3 * np.min(times, axis=0)
        rows.append((len(contacts), contacts.nodes.shape[1], float(detection), float(matrix)))
    return rows


def growth(n: int) -> tuple[int, float, float]:
    """Contacts of n^3 unit boxes on a floor, every second course shifted by half a box; ms of detection, ms of the look along a step."""
    boxes = [
        rigid_box(f"{k} {j} {i}", (1, 1, 1), (i + k % 2 / 2 - n / 2, j + k % 2 / 2 - n / 2, k + 0.5), 1.0)
        for k in range(n)
        for j in range(n)
        for i in range(n)
    ]
    model = build_model([rigid_box("floor", (4 * n, 4 * n, 1), (0, 0, -0.5), 1.0), *boxes])
    everything, still = Everything(model, 0.5), np.zeros((model.n_nodes, 3))
    contacts, times = everything(model.reference), []
    for shift in range(1, 4):
        there = model.reference + shift  # somewhere else: the answer for the same place is kept
        begin = process_time()
        everything(there)
        middle = process_time()
        everything(there + 0.5, still)
        times.append((middle - begin, process_time() - middle))
    detection, way = 1e3 * np.median(times, axis=0)
    return len(contacts), float(detection), float(way)


if __name__ == "__main__":
    print("| boxes | contacts | detection [ms] | with displacement [ms] | µs a contact |\n|---:|---:|---:|---:|---:|")
    for n in (5, 10, 14, 18):
        count, detection, way = growth(n)
        print(f"| {n**3} | {count} | {detection:.0f} | {way:.0f} | {1e3 * detection / count:.1f} |")
    print()
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
