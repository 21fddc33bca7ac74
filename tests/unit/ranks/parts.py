"""Work on rows and columns that ranks share. Writes what each rank has, as digests."""

import hashlib
import json
import os
from collections import Counter
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import scipy.sparse as sp

from fcsim import Body, Material, QuasiStatic, Simulation, Support, Traction, contact_surface
from fcsim.assembly.kinematics import ranges
from fcsim.assembly.kinematics.ranges import BodyRanges
from fcsim.assembly.model import build_model
from fcsim.assembly.whole import vectors as of_model
from fcsim.assembly.whole.kept_once import keep_in_common
from fcsim.assembly.whole.vectors import advanced, mass_times, placed
from fcsim.contact_detection import Contacts, ContactSurface, Detector, SurfacePair, contact_matrix_of_bodies, node_to_segment
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.node_to_segment import NodeToSegment
from fcsim.contact_law.one_point import at_one_point
from fcsim.linear.sparse.by_ranks import CONTACTS_FROM, RowsKept, normals_by_ranks, times_by_ranks, transposed_times_by_ranks
from fcsim.linear.sparse.columns import has_pattern
from fcsim.mesh import brick, rectangle
from fcsim.mesh.part import RigidBody
from fcsim.ranks import World, alone, for_parts, held_in_common, in_parts, largest, sharing, tasks
from fcsim.ranks.mapped_memory import in_common
from fcsim.timestep.reactions import reactions
from fcsim.timestep.reactions.reactions import Reactions, transferred
from fcsim.timestep.state import State


def digest(array: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def made(rows: int, least: int) -> tuple[list[str], int]:
    """Digests of rows made in parts, and how many this rank has made."""
    numbers, flags, own = np.empty((rows, 3)), np.empty(rows, dtype=bool), [0]

    def work(begin: int, end: int) -> None:
        k = np.arange(begin, end)
        numbers[begin:end], flags[begin:end] = np.sin(k[:, None] + np.arange(3)), k % 3 == 0
        own[0] += end - begin

    in_parts("rows", rows, least, work, numbers, flags)
    return [digest(numbers), digest(flags)], own[0]


def common(world: World | None) -> dict[str, object]:
    """Rows in memory that ranks have in common: digests, what was sent for them, and whether an array that rank 0 alone keeps stays as it
    is while others are made."""
    kept, digests, sent, sizes = None, [], [], []
    for k in range(12):
        before = 0 if world is None else world.bytes
        rows = for_parts((20_000, 3), 1)

        def work(begin: int, end: int, rows: np.ndarray = rows, k: int = k) -> None:
            rows[begin:end] = np.sin(np.arange(3 * begin, 3 * end) + k).reshape(-1, 3)

        in_parts("rows", len(rows), 1, work, rows)
        assert in_common(rows) == in_common(rows[5:]) == (world is not None)
        digests.append(digest(rows))
        sent.append(0 if world is None else world.bytes - before)
        if k == 0 and (world is None or world.number == 0):
            kept = rows
        del rows
        sizes.append(0 if world is None or world.common is None else world.common.bytes)
    still = kept is None or digest(kept) == digests[0]
    return {"digests": digests, "sent": max(sent[2:]), "still": still, "grows": sizes[-1] > sizes[2]}


def refused(world: World | None) -> tuple[list[str], bool]:
    """Rows where rank 0 gets no memory that others may have."""
    given = os.memfd_create
    if world is not None and world.number == 0:
        os.memfd_create = lambda name: given(name, 1 << 30)  # no such flag
    rows = for_parts((50_000, 2), 1)
    os.memfd_create = given

    def work(begin: int, end: int) -> None:
        rows[begin:end] = np.arange(2 * begin, 2 * end).reshape(-1, 2)

    in_parts("rows", len(rows), 1, work, rows)
    return [digest(rows)], in_common(rows)


class Held(NamedTuple):
    """What is kept once."""

    numbers: np.ndarray
    matrix: sp.csr_array
    nothing: None


def held(world: World | None) -> list[str]:
    """Numbers that all ranks have, by themselves, in sparse arrays and in named tuples, and what a model keeps of its nodes, once for all
    of them; small ones, and one rank's alone, not."""
    numbers, points = np.sin(np.arange(30_000.0)).reshape(-1, 3), np.random.default_rng(3).standard_normal((4000, 3))
    once, few = held_in_common(numbers), held_in_common(numbers[:5])
    with alone():
        own = held_in_common(numbers)
    assert in_common(once) == (world is not None) and held_in_common(once) is once
    assert own is numbers and not in_common(few)
    matrix = sp.random_array((9000, 50), density=0.05, rng=np.random.default_rng(5), format="csr")
    matrix.sum_duplicates()
    both = held_in_common(Held(numbers, matrix, None))
    assert both.nothing is None and np.array_equal(both.numbers, numbers) and both.matrix.has_sorted_indices
    assert np.array_equal(both.matrix @ np.arange(50.0), matrix @ np.arange(50.0))
    assert all(in_common(array) == (world is not None) for array in (both.numbers, both.matrix.data, both.matrix.indices))
    facet = {"face": np.array([[0, 1, 2]])}
    model = build_model([RigidBody(name, 2.0, np.eye(3), np.zeros(3), points, facet) for name in ("one", "other")])
    keep_in_common(model)
    kept = [once, model.reference, model.dof_of_node]
    assert all(in_common(array) == (world is not None) for array in kept)
    assert np.array_equal(model.reference, np.concatenate([points, points]))
    return [digest(array) for array in kept]


def products() -> list[str]:
    """Of A^T x for columns by threes and others, more and fewer than ranks share, beside SciPy's."""
    rng = np.random.default_rng(0)
    found = []
    for columns in (3 * CONTACTS_FROM + 3, CONTACTS_FROM + 1, 30):
        A = sp.random_array((500, columns), density=0.02, rng=rng, format="csc")
        x = rng.standard_normal(500)
        product = transposed_times_by_ranks(A, x)
        assert np.array_equal(product, A.T @ x)
        found.append(digest(product))
        r = rng.standard_normal(columns)
        for rows in (A, alike(A)):
            product = times_by_ranks(rows, r)
            assert np.array_equal(product, rows @ r)
            found.append(digest(product))
            for below in (0, 500):  # the pattern of the last one with other values, and its indptr with other indices
                for values in (np.sin(rows.data), np.cos(rows.data)):
                    B = sp.csc_array((values, rows.indices + below, rows.indptr), shape=(1000, columns))
                    B.has_canonical_format = True
                    product = times_by_ranks(B, r)
                    assert np.array_equal(product, B @ r)
                    found.append(digest(product))
    return found


def alike(A: sp.csc_array) -> sp.csc_array:
    """A with the rows of each third column in the two that follow it, as a contact's columns have them."""
    indptr, blocks = [0], []
    for j in range(0, A.shape[1] - 2, 3):
        blocks += 3 * [A.indices[A.indptr[j] : A.indptr[j + 1]]]
        indptr += [indptr[-1] + len(blocks[-1]) * k for k in (1, 2, 3)]
    rows = np.concatenate(blocks)
    B = sp.csc_array((np.cos(np.arange(len(rows))), rows, indptr), shape=(A.shape[0], len(indptr) - 1))
    B = sp.csc_array(sp.hstack([B, A[:, B.shape[1] :]]))
    B.sum_duplicates()
    return B


def at_one_place() -> list[str]:
    """H of many contacts between two rigid bodies, moved to one point, which is written to in the place of what was there, beside what a
    rank alone makes; twice, the second time with the pattern of the first."""
    rng, nc = np.random.default_rng(2), 4000
    points, facet = rng.standard_normal((4, 3)), {"face": np.array([[0, 1, 2]])}
    model = build_model([RigidBody(name, 2.0, np.eye(3), np.zeros(3), points, facet) for name in ("one", "other")])
    normals = rng.standard_normal((nc, 3))
    nodes, weights = np.column_stack([rng.integers(0, 4, nc), rng.integers(4, 8, nc)]), np.tile([1.0, -1.0], (nc, 1))
    frame = frames(normals / np.linalg.norm(normals, axis=1)[:, None])
    gap = 1.0 + rng.random(nc)
    contacts = Contacts(np.zeros((nc, 3)), frame, gap, np.zeros(nc), nodes, weights, np.tile([0, 1], (nc, 1)), np.arange(nc))

    def made() -> sp.csc_array:
        H = contact_matrix_of_bodies(contacts, model, np.zeros(model.n_dofs))
        at_one_point(model, H, contacts)
        return H

    found = [made(), made()]
    with alone():
        expected = made()
    for H in found:
        assert np.array_equal(H.toarray(), expected.toarray())
    return [digest(H.data) for H in found]


def contacts_found(world: World | None) -> list[str]:
    """Contacts of a plate above another one, all of them, then more and more of one side of it, and all again, beside what a rank alone
    finds: candidates are shared out anew where one rank has nearly all; what does not move is kept once for all ranks in the midst."""
    x, y = np.meshgrid(np.arange(21.0), np.arange(21.0), indexing="ij")
    corner = (21 * np.arange(20)[:, None] + np.arange(20)).ravel()
    up = corner[:, None] + [0, 21, 22, 1]
    below, above = ContactSurface(up, np.zeros(400, dtype=np.int64)), ContactSurface(441 + up[:, ::-1], np.ones(400, dtype=np.int64))
    detector = Detector([SurfacePair(above, below, mu=0.5, alert=0.1)], 882)
    found, cuts = [], []
    with patch.object(node_to_segment, "SHARED_FROM", 100), patch.object(tasks, "KEPT_FROM", 4096):
        for k, far in enumerate((99.0, 99.0, 12.0, 12.0, 6.0, 6.0, 99.0, 99.0)):
            if k == 3:
                detector.keep_in_common()
                (method,) = detector.methods
                assert isinstance(method, NodeToSegment)
                kept = method.known.facets.closed, method.slaves.closed, method.masters.nodes, method.topology.vertex, method.known.corners
                assert all(in_common(array) == (world is not None) for array in kept)
            z = np.where(x > far, 5.0, 0.01 * np.sin(x + k))
            positions = np.concatenate([np.stack([x, y, 0 * z], axis=2), np.stack([x + 0.1, y + 0.2, z], axis=2)]).reshape(-1, 3)
            contacts = detector(positions)
            with alone():
                expected = detector(positions)
            assert len(contacts) > 20
            assert all(np.array_equal(getattr(contacts, f.name), getattr(expected, f.name)) for f in fields(contacts) if f.name != "bulge")
            found += [digest(contacts.gap), *carried(contacts, k)]
            cuts.append(detector.methods[0]._cuts)  # type: ignore[union-attr]
    if world is not None:
        assert len(set(cuts)) > 2 and len(cuts[0]) == world.size + 1  # shared out, and once more
    return found


def carried(contacts: Contacts, k: int) -> list[str]:
    """Of four steps' reactions at some of these contacts, beside the same vectors in space taken contact by contact."""
    rng, memory = np.random.default_rng(k), []
    for _ in range(4):
        known = np.flatnonzero(rng.random(len(contacts)) < 0.9)
        frame = frames(np.linalg.qr(rng.standard_normal((len(known), 3, 3)))[0][:, 0])
        memory.append(Reactions(contacts.identity[known], frame, rng.standard_normal((len(known), 3))))
    with patch.object(reactions, "IN_COMMON_FROM", 1):
        found = transferred(memory, contacts)
    for of_step, r in zip(memory, found, strict=True):
        old, expected = {int(i): a for a, i in enumerate(of_step.identity)}, np.zeros((len(contacts), 3))
        for a, identity in enumerate(contacts.identity.tolist()):
            if identity in old:
                expected[a] = contacts.frame[a] @ (of_step.frame[old[identity]].T @ of_step.r[old[identity]])
        assert np.allclose(r.reshape(-1, 3), expected, rtol=0, atol=1e-13)
    return [digest(r) for r in found]


def kept_rows() -> list[str]:
    """Some rows of a matrix by columns, moved, of more and fewer columns than ranks share."""
    rng, found = np.random.default_rng(1), []
    for columns in (3 * CONTACTS_FROM + 3, 30):
        A = sp.random_array((500, columns), density=0.02, rng=rng, format="csc")
        A.sum_duplicates()
        for place in (
            np.where(np.arange(500) % 7, np.arange(500), -1),
            np.where(np.arange(500) < 300, np.arange(500), np.arange(500) - 50),
        ):
            place = np.where((np.arange(500) >= 300) & (np.arange(500) < 350), -1, place)
            keep, last = RowsKept(place, 500), None
            for B in (A, sp.csc_array((A.data + 1.0, A.indices, A.indptr), shape=A.shape), 2 * A):
                B.sum_duplicates()
                kept, expected = keep(B), np.zeros(B.shape)
                expected[place[place >= 0]] = B.toarray()[place >= 0]
                assert np.array_equal(kept.toarray(), expected)
                found += [digest(kept.indptr), digest(kept.indices), digest(kept.data), str(last is not None and has_pattern(kept, *last))]
                last = kept.indptr, kept.indices
    return found


def normals(world: World | None) -> list[str]:
    """Sums over the squares of each third column, beside dense ones: made in parts, in memory that ranks have in common."""
    rng = np.random.default_rng(4)
    A = sp.random_array((60, 3 * 5000), density=0.1, rng=rng, format="csc")
    weight, some = rng.random(60), np.arange(60) % 20 == 0
    found = normals_by_ranks(A, weight, some, 3)
    assert all(in_common(array) == (world is not None) for array in found)
    squares = weight[:, None] * A[:, ::3].toarray() ** 2
    touched = squares[some].any(axis=0)
    assert np.array_equal(found[2], touched)
    for own, expected in zip(found[:2], (squares.sum(axis=0), squares[~some].sum(axis=0)), strict=True):
        assert np.allclose(own, np.where(touched, expected, 0.0), rtol=1e-13, atol=0)
    return [digest(array) for array in found]


def looked_at() -> list[float]:
    """The largest of what ranks see of many numbers, and of few."""
    x = np.sin(np.arange(1000.0) ** 2)
    return [float(a) for least in (1, 1001) for a in largest("rows", 1000, least, lambda i, j: np.array([x[i:j].max(), -x[i:j].min()]))]


def entered() -> tuple[list[str], int]:
    """What is said of two soft blocks, each with one facet on fifty, and how many rules look for that on this rank: one a pair of surfaces,
    and those of the steps."""
    steel = Material(E=210e9, nu=0.0, density=7800.0)
    bodies, pairs, made = [], [], Counter[str]()
    for k, cells in enumerate((1, 2)):
        upper, lower = (rectangle(f"{name} {k}", (1.0, 1.0), (n, 2), steel) for name, n in (("above", cells), ("below", 50)))
        bodies += [Body(upper.name, upper, translation=(2.0 * k, 1.0)), Body(lower.name, lower, translation=(2.0 * k, 0.0))]
    loads = [Traction(f"above {k}", "y+", (0.0, -1e6)) for k in (0, 1)]
    held = [Support(f"below {k}", ("x", "y"), "y-") for k in (0, 1)] + [Support(f"above {k}", ("x",), "y+") for k in (0, 1)]
    model = build_model(bodies, supports=held, loads=loads)
    for k in (0, 1):
        surfaces = (contact_surface(model, [(f"above {k}", "y-")]), contact_surface(model, [(f"below {k}", "y+")]))
        pairs.append(SurfacePair(*surfaces, 0.0, 0.02, "nodes"))
    make = Detector.__post_init__

    def counted(detector: Detector) -> None:
        made[detector.pairs[0].candidates] += 1
        make(detector)

    detection = Detector(pairs, model.n_nodes)
    with patch.object(Detector, "__post_init__", counted):
        (step,) = Simulation(model, detection, QuasiStatic(1.0, eta=1e-3), 1)
    return [said for said in step.remarks if "between its points" in said], made["nodes"]


def in_runs(world: World | None) -> tuple[str, bool]:
    """A vector that runs of bodies write to, and numbers behind it that all write: it lies once on a machine, and nothing of it is sent."""
    group: Any = SimpleNamespace(first=300 * np.arange(200), size=300)
    ranges = BodyRanges([group])
    before, x = 0 if world is None else world.bytes, ranges.vector(60_012)
    x[60_000:] = 1.0

    def work(edges: np.ndarray) -> None:
        x[edges[0] : edges[-1]] = np.sin(np.arange(edges[0], edges[-1]))

    ranges.share("runs", work, x)
    return digest(x), world is None or (in_common(x) and world.bytes - before < 1000)


def vectors(world: World | None) -> list[str]:
    """Vectors of a model that ranks make together, beside those of one process; a state keeps nothing of what one rank makes alone."""
    facet = {"face": np.array([[0, 1, 2]])}
    part = brick("brick", (1.0, 1.0, 1.0), (2, 2, 1), Material(1e9, 0.2, 2000.0))
    other = RigidBody("other", 2.0, np.diag([1.0, 2.0, 3.0]), np.zeros(3), np.eye(3), facet)
    model = build_model([*(Body(f"brick {k}", part) for k in range(150)), other], kinematics="linear")
    x, v = (0.1 * np.random.default_rng(seed).standard_normal(model.n_dofs) for seed in (0, 1))
    state, asked = State(0.0, x, v), []

    def ask() -> np.ndarray:
        asked.append(len(asked))
        return mass_times(model, v, model.rigid_mass(x))

    with patch.object(tasks, "NUMBERS_FROM", 1000), patch.object(of_model, "NODES_FROM", 1000), patch.object(ranges, "SHARED_FROM", 1000):
        with alone():
            assert not in_common(state.kept(("momentum",), model, ask))
        momentum = state.kept(("momentum",), model, ask)
        assert state.kept(("momentum",), model, ask) is momentum and len(asked) == 1 + (world is not None)
        found = [momentum, of_model.sum_by_ranks(0.5, x, 0.25, v), advanced(model, x, 0.1, v), placed(model, x)]
    expected = [model.apply_mass(v, model.rigid_mass(x)), 0.5 * x + 0.25 * v, model.advance(x, 0.1 * v), model.positions(x)]
    assert all(np.array_equal(a, b) for a, b in zip(found, expected, strict=True))
    assert all(in_common(array) == (world is not None) for array in found)
    return [digest(array) for array in found]


def sent(world: World | None) -> bool:
    """Whether each rank gets what the others send to it alone: of number i to j i + 2 j numbers 10 i + j."""
    if world is None:
        return True
    k = np.arange(world.size)
    lengths = k[:, None] + 2 * k
    own = np.repeat(10 * world.number + k, lengths[world.number])
    return np.array_equal(world.exchanged(own, lengths), np.repeat(10 * k + world.number, lengths[:, world.number]))


def main(folder: Path) -> None:
    with sharing() as world:
        number = 0 if world is None else world.number
        rows, few, several = made(1001, 1), made(1001, 1002), made(2, 1)
        with alone():
            by_itself = made(1001, 1)
        found = {
            "rows": rows,
            "few": few,
            "several": several,
            "alone": by_itself,
            "products": products(),
            "largest": looked_at(),
            "entered": entered(),
            "runs": in_runs(world),
            "vectors": vectors(world),
            "sent": sent(world),
            "kept": [*kept_rows(), *normals(world), *at_one_place(), *contacts_found(world)],
            "held": held(world),
            "common": common(world),
            "refused": refused(world),
        }
        (folder / f"{number}.json").write_text(json.dumps(found), encoding="utf-8")
