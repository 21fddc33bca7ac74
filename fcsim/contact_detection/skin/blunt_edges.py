"""Blunt edges of a skin: where faces that are flat meet at a small angle, and nothing on either side turns on.

A curved surface turns the same way at one edge after another; a ridge, the foot of a ramp and the teeth of a serrated joint turn once,
or back again. Normals interpolated over those would take the teeth away: two serrated joints of one facet a flank slid on each other as
flat ones do, at T / N = mu in place of tan(arctan(mu) + i) (F. D. Patton, Multiple modes of shear failure in rock, 1966).
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray

BENT = 1e-9
"""1 - cos of the angle from which on two facets are no single plane."""
GOES_ON = 0.05
"""Share of an edge's turn by which a facet beside its two facets must turn on, for the edge to be one of a curve: facets of a curve
may differ in length."""


def blunt(facets: IntArray, sides: IntArray, normal: FloatArray, edge_facets: IntArray, cosine: FloatArray, patch: IntArray) -> BoolArray:
    """Return which edges (ne,) are blunt edges between flat faces: n_f - n_g is the turn over the edge from g to f, and no facet k of the
    patch that touches f turns on, (n_k - n_f) . (n_f - n_g) > `GOES_ON` |n_f - n_g|^2, nor does one that touches g from f to g.

    facets (nf, 4), of which the first `sides` (nf,) count; normal (nf, d); edge_facets (ne, 2), cosine (ne,) between their normals; patch
    (nf,): number of the part of the surface whose facets meet at small angles.
    """
    found = np.zeros(len(edge_facets), dtype=bool)
    bent = np.flatnonzero((patch[edge_facets[:, 0]] == patch[edge_facets[:, 1]]) & (cosine < 1.0 - BENT))
    if not len(bent):
        return found
    real = np.arange(facets.shape[1]) < sides[:, None]
    order = np.argsort(facets[real], kind="stable")
    star = np.broadcast_to(np.arange(len(facets))[:, None], facets.shape)[real][order]
    first = np.searchsorted(facets[real][order], np.arange(facets.max() + 2))
    found[bent] = True
    for here, there in (edge_facets[bent].T, edge_facets[bent, ::-1].T):
        turn = normal[here] - normal[there]
        least = GOES_ON * np.einsum("ed,ed->e", turn, turn)
        for corner in range(facets.shape[1]):
            row = np.flatnonzero(real[here, corner])
            begin = first[facets[here[row], corner]]
            count = first[facets[here[row], corner] + 1] - begin
            row, k = np.repeat(row, count), star[np.repeat(begin - np.cumsum(count) + count, count) + np.arange(count.sum())]
            on = np.einsum("cd,cd->c", normal[k] - normal[here[row]], turn[row]) > least[row]
            found[bent[row[on & (patch[k] == patch[here[row]])]]] = False
    return found
