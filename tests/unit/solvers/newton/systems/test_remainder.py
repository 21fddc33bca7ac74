"""What is left of the equations on the border: solved by its own factor, or by GMRES with that of an earlier system on other unknowns."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla
from numpy.testing import assert_allclose

from fcsim.solvers.newton.systems import remainder
from fcsim.solvers.newton.systems.remainder import Factored, Remainder

CONTACTS = 200


class System:
    """A random border of which tangential components are unknown, in a few contacts all three."""

    def __init__(self, seed: int, contacts: int = CONTACTS) -> None:
        self.random = np.random.default_rng(seed)
        root = self.random.standard_normal((3 * contacts, 3 * contacts + 9))
        self.G = (root @ root.T / contacts + 0.5 * np.eye(3 * contacts)).astype(np.float32)
        self.unknown = np.ones((contacts, 3), dtype=bool)
        self.unknown[contacts // 10 :, 0] = False
        self.outer, self.inner, self.rhs, self.known = (
            self.random.standard_normal(shape) for shape in ((contacts, 3, 3), (contacts, 3, 3), (contacts, 3), (contacts, 3))
        )
        self.outer, self.inner = 0.3 * self.outer + 2 * np.eye(3), 0.3 * self.inner + np.eye(3)
        self.x = np.where(self.unknown, 0, self.random.standard_normal((contacts, 3)))

    def defect(self, x: np.ndarray) -> float:
        """The norm of outer (known + G x) + inner x - rhs on the unknown components, in double precision."""
        J = sla.block_diag(*self.outer) @ self.G.astype(float) + sla.block_diag(*self.inner)
        left = J @ x.ravel() + np.einsum("aij,aj->ai", self.outer, self.known).ravel() - self.rhs.ravel()
        return float(np.linalg.norm(left[self.unknown.ravel()]))

    def remainder(self, earlier: Factored | None, target: float) -> Remainder:
        single = (array.astype(np.float32) for array in (self.G, self.outer, self.inner))
        return Remainder(*single, self.unknown, earlier, inexact=target > 0)

    def completed(self, own: Remainder, target: float) -> np.ndarray:
        x = self.x.copy()
        own.complete(x, self.known.astype(np.float32), self.rhs.astype(np.float32), np.arange(len(x)), target)
        assert_allclose(x[~self.unknown], self.x[~self.unknown])
        return x

    def complete(self, earlier: Factored | None, target: float) -> tuple[np.ndarray, Factored | None]:
        """x, and the factor that serves the next system."""
        own = self.remainder(earlier, target)
        return self.completed(own, target), own.factored

    def scale_rows(self) -> None:
        """Another rho: the equations of every contact are combined anew, and a little of their coefficients changes."""
        own = np.eye(3) + 0.5 * self.random.standard_normal((len(self.rhs), 3, 3))
        own[~self.unknown] = np.eye(3)[np.nonzero(~self.unknown)[1]]  # what is known has no equation to combine with
        for contact in np.flatnonzero(~self.unknown[:, 0]):
            own[contact, 1:, 0] = 0
        self.outer, self.inner, self.rhs = own @ self.outer, own @ self.inner, np.einsum("aij,aj->ai", own, self.rhs)
        self.inner = self.inner + 0.01 * self.random.standard_normal(self.inner.shape)

    def change(self, contacts: np.ndarray) -> None:
        """Let all components of the contacts be unknown where the tangential ones were, none where all were."""
        self.unknown = self.unknown.copy()
        self.unknown[contacts] = ~self.unknown[contacts, :1]
        self.x = np.where(self.unknown, 0, self.random.standard_normal(self.x.shape))


@pytest.fixture
def factored(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The sizes of the matrices that were factored."""
    sizes: list[int] = []
    lu = remainder.DenseLU

    def counted(A: np.ndarray, overwrite: bool = False) -> object:
        sizes.append(len(A))
        return lu(A, overwrite)

    monkeypatch.setattr(remainder, "DenseLU", counted)
    monkeypatch.setattr(remainder, "APPROXIMATE_FROM", 100)
    return sizes


def test_exact(factored: list[int]) -> None:
    system = System(0)
    size = np.count_nonzero(system.unknown)
    x, earlier = system.complete(None, 0.0)
    assert system.defect(x) <= 1e-4 * np.linalg.norm(system.rhs)
    system.change(np.array([3, 50]))
    assert system.defect(system.complete(earlier, 0.0)[0]) <= 1e-4 * np.linalg.norm(system.rhs)
    assert factored == [size, np.count_nonzero(system.unknown)]


def test_other_rows(factored: list[int]) -> None:
    system, earlier = System(1), None
    target = 1e-3 * float(np.linalg.norm(system.rhs))
    for _ in range(3):
        x, earlier = system.complete(earlier, target)
        assert system.defect(x) <= 1.01 * target
        system.scale_rows()
    assert factored == [np.count_nonzero(system.unknown)]


@pytest.mark.parametrize("contacts", [[30, 60], [2, 5], [1, 31, 32, 199]], ids=["come", "go", "both"])
def test_other_unknowns(factored: list[int], contacts: list[int]) -> None:
    system = System(2)
    size, target = np.count_nonzero(system.unknown), 1e-3 * float(np.linalg.norm(system.rhs))
    _, earlier = system.complete(None, target)
    system.change(np.array(contacts))
    system.scale_rows()
    own = system.remainder(earlier, target)
    for _ in range(2):
        assert system.defect(system.completed(own, target)) <= 1.01 * target
        system.rhs = system.random.standard_normal(system.rhs.shape)
    assert factored[0] == size
    assert all(small <= 0.1 * size for small in factored[1:]), "only the complement of what changed is factored"


def test_new_contacts(factored: list[int]) -> None:
    """A border that has grown: contacts beyond the factor's are all new."""
    system = System(3)
    target = 1e-3 * float(np.linalg.norm(system.rhs))
    whole = (system.G, system.outer, system.inner, system.unknown, system.rhs, system.known, system.x)
    few = CONTACTS - 5
    system.G = system.G[: 3 * few, : 3 * few]
    system.outer, system.inner, system.unknown, system.rhs, system.known, system.x = (array[:few] for array in whole[1:])
    _, earlier = system.complete(None, target)
    system.G, system.outer, system.inner, system.unknown, system.rhs, system.known, system.x = whole
    assert system.defect(system.complete(earlier, target)[0]) <= 1.01 * target
    assert factored[1:] == [10]


def test_many_changes(factored: list[int]) -> None:
    system = System(4)
    target = 1e-3 * float(np.linalg.norm(system.rhs))
    _, earlier = system.complete(None, target)
    system.change(np.arange(20, 80))
    assert system.defect(system.complete(earlier, target)[0]) <= 1.01 * target
    assert factored[-1] == np.count_nonzero(system.unknown), "factored anew"


def test_singular_own_block(factored: list[int]) -> None:
    """A contact whose own equations are singular cannot be scaled: factored anew."""
    system = System(5)
    target = 1e-3 * float(np.linalg.norm(system.rhs))
    _, earlier = system.complete(None, target)
    system.G[:] = np.float32(0.01) * np.roll(np.eye(3 * CONTACTS), 3, axis=1) + np.float32(0.01) * np.roll(np.eye(3 * CONTACTS), -3, axis=1)
    system.inner[40] = 0  # its own block is then zero, the coupling with its neighbours is all there is
    x, _ = system.complete(earlier, target)
    assert np.all(np.isfinite(x))
    assert system.defect(x) <= 1e-2 * np.linalg.norm(system.rhs)
    assert factored[-1] == np.count_nonzero(system.unknown)
