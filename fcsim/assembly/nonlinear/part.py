"""The inner forces of all bodies of one part, whose material is not linear: sums over its cells and quadrature points, some at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.discretisation import once_per_part
from fcsim.assembly.elements import VOIGT
from fcsim.assembly.nonlinear._tangent_kernels import scatter_blocks, scatter_nodes
from fcsim.assembly.nonlinear.cells import CellStrain, PartCells, cell_strain, part_cells
from fcsim.assembly.nonlinear.foreseen import foreseen
from fcsim.assembly.nonlinear.mean_strain import respond_between
from fcsim.assembly.nonlinear.strain_measures import InStrain, PlaneStress
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.mesh.material.by_region import ByRegion, as_law
from fcsim.mesh.material.law import Circumstances, PointLaw, initial_variables
from fcsim.mesh.part import Part


def laws_of(part: Part) -> tuple[tuple[PointLaw, IntArray], ...]:
    """The laws of a part's cells and the cells of each."""
    if isinstance(part.material, ByRegion):
        return tuple((as_law(material), part.regions[name]) for name, material in part.material.materials.items())
    return ((as_law(part.material), np.arange(len(part.cells))),)


CELLS_AT_ONCE = 1024
"""Bounds the memory: some 20 MB of tangents of hexahedra."""


@dataclass(frozen=True, eq=False)
class NodeGraph:
    """Which nodes of a part share cells: a block matrix by rows, and the block of each pair of nodes of each cell, place (nc, k, k)."""

    indptr: IntArray
    indices: IntArray
    place: IntArray

    def matrix(self, blocks: FloatArray) -> sp.csr_array:
        """Blocks (nblocks, d, d) as one csr_array; entries of no block are left out, zeros within are kept."""
        n = len(self.indptr) - 1
        d = blocks.shape[-1]
        return with_short_indices(sp.csr_array(sp.bsr_array((blocks, self.indices, self.indptr), shape=(n * d, n * d))))


@once_per_part
def node_graph(part: Part) -> NodeGraph:
    """The graph of a part's nodes."""
    cells, n = part.cells, len(part.points)
    keys = cells[:, :, None] * n + cells[:, None, :]
    unique, place = np.unique(keys, return_inverse=True)
    indptr = np.searchsorted(unique // n, np.arange(n + 1))
    return NodeGraph(indptr, unique % n, place.reshape(keys.shape))


@dataclass(frozen=True, eq=False)
class Instant:
    """When the inner forces are asked: t [s] of the strain, dt [s] since the internal variables, and with damping beta [s] the nodes'
    velocities v (nb, nn, d) and their change `rate` [1/s] for a unit change of displacements; start (nb, nn, d): displacements at the
    beginning of the step, where the forces are those `share` of the way from there to its end, see `mean_strain`; earlier (nb, nn, d):
    displacements from which the tangent's stresses are linear, see `foreseen`."""

    t: float
    dt: float
    beta: float = 0.0
    v: FloatArray | None = None
    rate: float = 0.0
    start: FloatArray | None = None
    share: float = 1.0
    earlier: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Inner:
    """Of the bodies of a part, in its axes: force (nb, nn, d) [N]; energy, dissipated (nb,) [J]; viscous (nb,) [W] that damping takes;
    variables (nb, ...) flat a body; blocks (nb, nblocks, d, d) [N/m] of the tangent or None; admissible (nb,); stress (nb, nc, 6) [Pa],
    Cauchy's, means of the cells' points, in the body's turned axes."""

    force: FloatArray
    energy: FloatArray
    dissipated: FloatArray
    viscous: FloatArray
    variables: FloatArray
    blocks: FloatArray | None
    admissible: FloatArray
    stress: FloatArray


@dataclass(frozen=True, eq=False)
class Region:
    """Cells of one law: numbers (nc,) among the part's; law asked with F; strain: how cells are strained; rotates: whether rotation is
    no strain; reference: its elasticity (3, 3, 3, 3) [Pa] at F = 1; first (k,): internal variables at the beginning."""

    numbers: IntArray
    law: PointLaw
    strain: type[CellStrain]
    rotates: bool
    reference: FloatArray
    first: FloatArray

    @property
    def width(self) -> int:
        """Number of internal variables of a point."""
        return len(self.first)


class NonlinearPart:
    """A part with laws of points; turning: whether laws of small strain are taken with any rotation."""

    def __init__(self, part: Part, turning: bool) -> None:
        self.part, self.graph, self._data = part, node_graph(part), part_cells(part)
        laws = laws_of(part)
        self.finite = any(law.strain == "finite" for law, _ in laws)
        self.of_small_strain = np.concatenate([np.empty(0, dtype=np.int64), *(cells for law, cells in laws if law.strain != "finite")])
        self.turning = turning or self.finite
        self.regions = tuple(self._region(law, numbers) for law, numbers in laws)
        self.size = sum(len(r.numbers) * self._data.weight.shape[1] * r.width for r in self.regions)

    def _region(self, law: PointLaw, numbers: IntArray) -> Region:
        finite = law.strain == "finite"
        if self.part.dimension == 2 and self.part.plane == "stress":
            law = PlaneStress(law)
        asked: PointLaw = law if finite else InStrain(law, self.turning)
        first = initial_variables(law)
        at = Circumstances(self._data.place[numbers].reshape(-1, 3)[:1], 0.0, 0.0)  # fields need not be finite elsewhere
        answer = asked.respond(np.eye(3)[None], first[None], at, True)
        assert answer.tangent is not None
        return Region(numbers, asked, cell_strain(self.part, self.turning), self.turning, answer.tangent[0], first)

    @property
    def first_tangent(self) -> FloatArray:
        """The tangent (nblocks, d, d) [N/m] at the beginning."""
        inner = self.inner(np.zeros((1, *self.part.points.shape)), self.initial[None], Instant(0.0, 0.0), True)
        assert inner.blocks is not None
        return inner.blocks[0]

    @property
    def initial(self) -> FloatArray:
        """Internal variables (size,) of one body at the beginning."""
        points = self._data.weight.shape[1]
        return np.concatenate([np.tile(r.first, len(r.numbers) * points) for r in self.regions] or [np.empty(0)])

    def region_variables(self, variables: FloatArray) -> Iterator[tuple[Region, FloatArray]]:
        """Each region with its share (nb, nc, nq, k) of the bodies' internal variables (nb, size)."""
        begin, points = 0, self._data.weight.shape[1]
        for region in self.regions:
            end = begin + len(region.numbers) * points * region.width
            yield region, variables[:, begin:end].reshape(len(variables), len(region.numbers), points, region.width)
            begin = end

    def cell_variables(self, variables: FloatArray) -> dict[str, FloatArray]:
        """The internal variables by name, (nb, nc) or (nb, nc, components): means of the cells' points, nan where a law has none of the
        name."""
        found: dict[str, FloatArray] = {}
        for region, own in self.region_variables(variables):
            weight = self._data.weight[region.numbers]
            mean = np.einsum("cq,bcqk->bck", weight / weight.sum(axis=1, keepdims=True), own)
            begin = 0
            for variable in region.law.variables:
                shape = (len(own), len(self.part.cells), variable.components)
                found.setdefault(variable.name, np.full(shape, np.nan))[:, region.numbers] = mean[..., begin : begin + variable.components]
                begin += variable.components
        return {name: values[..., 0] if values.shape[2] == 1 else values for name, values in found.items()}

    def point_stresses(self, u: FloatArray, variables: FloatArray, t: float, cauchy: bool = False) -> Iterator[tuple[Region, FloatArray]]:
        """Each region with the stress (nc, nq, 3, 3) [Pa] at its points, the second of Piola and Kirchhoff or Cauchy's (of small rotation:
        stress), of one body with the nodes' displacements u (nn, d) and internal variables (size,) at t [s]."""
        instant = Instant(t, 0.0)
        for region, own in self.region_variables(variables[None]):
            found = []
            for begin in range(0, len(region.numbers), CELLS_AT_ONCE):
                some = slice(begin, begin + CELLS_AT_ONCE)
                found.append(_Points(self._data, region.numbers[some], region, u, instant, 0).stress(own[0, some], instant, cauchy))
            yield region, np.concatenate(found)

    def inner(self, u: FloatArray, variables: FloatArray, instant: Instant, tangent: bool) -> Inner:
        """Forces and all else of bodies with the nodes' displacements u (nb, nn, d) [m] and internal variables (nb, size)."""
        nb, nn, d = u.shape
        cells = self._data.cells
        force, stress = np.zeros((nb, nn, d)), np.zeros((nb, len(cells), 6))
        energy, dissipated, viscous = np.zeros((3, nb))
        admissible = np.ones(nb, dtype=bool)
        after = np.empty_like(variables)
        blocks = np.zeros((nb, len(self.graph.indices), d, d)) if tangent else None
        afters = self.region_variables(after)
        for (region, before), (_, new) in zip(self.region_variables(variables), afters, strict=True):
            for b in range(nb):
                for begin in range(0, len(region.numbers), CELLS_AT_ONCE):
                    some = slice(begin, begin + CELLS_AT_ONCE)
                    numbers = region.numbers[some]
                    points = _Points(self._data, numbers, region, u[b], instant, b)
                    out = points.respond(before[b, some], instant, tangent)
                    new[b, some] = out.variables
                    scatter_nodes(out.force, cells[numbers], force[b])
                    energy[b] += out.energy
                    dissipated[b] += out.dissipated
                    viscous[b] += out.viscous
                    admissible[b] &= out.admissible
                    stress[b, numbers] = out.stress
                    if blocks is not None and out.tangent is not None:
                        scatter_blocks(out.tangent, self.graph.place[numbers], d, blocks[b])
        return Inner(force, energy, dissipated, viscous, after, blocks, admissible, stress)


class _Kinematics(dict[bool, NonlinearPart]):
    """A part without and with rotations, each made when it is asked for; it keeps no reference to the part itself."""

    def __init__(self, part: Part) -> None:
        super().__init__()
        self._part = replace(part)

    def __missing__(self, turning: bool) -> NonlinearPart:
        self[turning] = NonlinearPart(self._part, turning)
        return self[turning]


@once_per_part
def nonlinear_part(part: Part) -> _Kinematics:
    """The part's laws and cells, by whether laws of small strain are taken with any rotation: made once."""
    return _Kinematics(part)


@dataclass(frozen=True, eq=False)
class _Out:
    force: FloatArray
    energy: float
    dissipated: float
    viscous: float
    variables: FloatArray
    tangent: FloatArray | None
    admissible: bool
    stress: FloatArray


class _Points:
    """Some cells of one body."""

    def __init__(self, data: PartCells, numbers: IntArray, region: Region, u: FloatArray, instant: Instant, body: int) -> None:
        self._weight, self._place, self._region = data.weight[numbers], data.place[numbers], region
        cells = data.cells[numbers]
        self._strain = region.strain(data.gradient[numbers], self._weight, u[cells])
        self._rate = None if instant.v is None else self._strain.rate(instant.v[body][cells])
        self._ends: tuple[FloatArray, FloatArray] | None = None
        if instant.start is not None and instant.share < 1 and region.rotates:
            start = instant.start[body]
            end = start + (u - start) / instant.share
            first, last = (region.strain(data.gradient[numbers], self._weight, x[cells]).F.reshape(-1, 3, 3) for x in (start, end))
            self._ends = first, last
        self._change: tuple[FloatArray, FloatArray] | None = None
        if instant.earlier is not None and region.rotates:
            earlier = instant.earlier[body]
            strain = region.strain(data.gradient[numbers], self._weight, earlier[cells])
            self._change = strain.F, strain.rate((u - earlier)[cells])

    def respond(self, before: FloatArray, instant: Instant, tangent: bool) -> _Out:
        F, w = self._strain.F, self._weight
        flat = F.reshape(-1, 3, 3)
        at = Circumstances(self._place.reshape(-1, 3), instant.t, instant.dt)
        law, own = self._region.law, before.reshape(len(flat), -1)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            if self._ends is None:
                answer = law.respond(flat, own, at, tangent)
            else:
                answer = respond_between(law, (self._ends[0], flat, self._ends[1]), instant.share, own, at, tangent)
        J = np.linalg.det(flat)
        admissible = bool(np.all(np.isfinite(answer.stress)) and np.all(J > 0))
        P, A = answer.stress.reshape(F.shape), None
        if answer.tangent is not None and admissible:
            A = answer.tangent.reshape(*w.shape, 9, 9)  # symmetric, since problems are: of laws that are not, the symmetric part
            A = (0.5 * (A + A.swapaxes(2, 3))).reshape(*w.shape, 3, 3, 3, 3)
        viscous = 0.0
        if instant.beta and self._rate is not None:
            P, A, viscous = self._damped(P, A, instant)
        weighted = w[..., None, None] * P
        forces = self._strain.force(weighted)
        if A is not None and self._change is not None:
            P, A = self._foreseen(law, own, at, P, A)
            weighted = w[..., None, None] * P
        return _Out(
            forces,
            float(np.vdot(w, answer.energy)),
            float(np.vdot(w, answer.dissipated)),
            viscous,
            answer.variables.reshape(before.shape),
            None if A is None else self._strain.tangent(weighted, w[..., None, None, None, None] * A),
            admissible,
            self._mean_stress(answer.stress.reshape(F.shape), J.reshape(w.shape)),
        )

    def stress(self, before: FloatArray, instant: Instant, cauchy: bool) -> FloatArray:
        """F^-1 P or P F^T / J (nc, nq, 3, 3) [Pa], of small rotation P."""
        F = self._strain.F
        at = Circumstances(self._place.reshape(-1, 3), instant.t, instant.dt)
        P = self._region.law.respond(F.reshape(-1, 3, 3), before.reshape(F[..., 0, 0].size, -1), at, False).stress.reshape(F.shape)
        if not self._region.rotates:
            return P
        return np.asarray(P @ np.swapaxes(F, -1, -2) / np.linalg.det(F)[..., None, None] if cauchy else np.linalg.solve(F, P))

    def _foreseen(
        self, law: PointLaw, before: FloatArray, at: Circumstances, P: FloatArray, A: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """P and A with the stresses that the earlier tangent foresaw, see `foreseen`."""
        assert self._change is not None
        first, change = (own.reshape(-1, 3, 3) for own in self._change)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            answer = law.respond(first, before, at, True)
        assert answer.tangent is not None
        shape = self._strain.F.shape
        stress, F, P = (own.reshape(-1, 3, 3) for own in (answer.stress, self._strain.F, P))
        P, A = foreseen((first, stress, answer.tangent.reshape(-1, 3, 3, 3, 3)), change, F, P, A.reshape(-1, 3, 3, 3, 3))
        return P.reshape(shape), A.reshape(*shape, 3, 3)

    def _damped(self, P: FloatArray, A: FloatArray | None, instant: Instant) -> tuple[FloatArray, FloatArray | None, float]:
        """P + F beta C : dE/dt, its derivative as far as it is symmetric, and the power [W] of the damping; C of the reference: no stress
        from rotation, never negative, and beta K v where strains are small."""
        F = self._strain.F if self._region.rotates else np.broadcast_to(np.eye(3), self._strain.F.shape)
        assert self._rate is not None  # the instant of a damped body has velocities
        dE = np.swapaxes(F, -1, -2) @ self._rate
        dE = 0.5 * (dE + np.swapaxes(dE, -1, -2))
        C = instant.beta * self._region.reference
        S = np.einsum("ijkl,cqkl->cqij", C, dE, optimize=True)
        power = float(np.einsum("cq,cqij,cqij->", self._weight, S, dE, optimize=True))
        if A is not None:
            CF = np.einsum("MJNL,cqkN->cqMJkL", instant.rate * C, F, optimize=True)
            A = A + np.einsum("cqiM,cqMJkL->cqiJkL", F, CF, optimize=True)
            if self._region.rotates:
                for i in range(3):
                    A[..., i, :, i, :] += S
        return P + F @ S, A, power

    def _mean_stress(self, P: FloatArray, J: FloatArray) -> FloatArray:
        """Cauchy's stress (nc, 6) [Pa] as means of the cells' points: P F^T / J; of small strain and rotation P itself."""
        with np.errstate(invalid="ignore", divide="ignore"):
            sigma = P @ np.swapaxes(self._strain.F, -1, -2) / J[..., None, None] if self._region.rotates else P
        mean = np.einsum("cq,cqij->cij", self._weight, sigma) / self._weight.sum(axis=1)[:, None, None]
        rows, columns = np.transpose(VOIGT)
        return mean[:, rows, columns]
