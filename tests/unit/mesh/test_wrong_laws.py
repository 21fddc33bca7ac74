"""A user's mistakes in a material are answered by one error that names them; materials that are right are not refused."""

from typing import Any

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.material import Hyperelastic, Material, OfStretches, PointFunction, Variable, check_law
from fcsim.mesh.material.law import Circumstances, as_tensor

C = as_tensor(Material(3e9, 0.25, 1.0).elasticity)


def hooke(strain: np.ndarray, share: float = 1.0) -> tuple[Any, ...]:
    return np.einsum("ijkl,nkl->nij", C, strain), share * np.broadcast_to(C, (len(strain), 3, 3, 3, 3))


def green(F: np.ndarray, before: np.ndarray, at: Any) -> tuple[Any, ...]:
    """Small strain mistaken for finite: P = C (sym F - 1)."""
    return (*hooke(0.5 * (F + F.transpose(0, 2, 1)) - np.eye(3)), before)


@pytest.mark.parametrize(
    ("function", "strain", "text"),
    [
        (lambda e, b, at: (*hooke(e, 2.0), b), "small", "derivative of the stress"),
        (lambda e, b, at: (hooke(e)[0], 1e-6 * hooke(e)[1], b), "small", "derivative of the stress"),
        (lambda e, b, at: (hooke(e)[0] + 1e9 * e @ np.diag([1, 2, 3]), hooke(e)[1], b), "small", "symmetric stress"),
        (lambda e, b, at: (hooke(e)[0] / np.linalg.norm(e, axis=(1, 2))[:, None, None], hooke(e)[1], b), "small", "finite stress"),
        (lambda e, b, at: (*hooke(e), b[:, 3]), "small", "raised IndexError"),
        (green, "finite", "turns with the body"),
        (lambda e, b, at: (*(-x for x in hooke(e)), b), "small", "is its sign wrong"),
        (lambda e, b, at: (*(0 * x for x in hooke(e)), b), "small", "got none at strains"),
        (lambda e, b, at: (*hooke(e), b, 0 * e[:, 0, 0], 0 * e[:, 0, 0] - 1e3), "small", "dissipated energy >= 0"),
        (lambda e, b, at: (*hooke(e), b, np.einsum("nij,nij->n", e, hooke(e)[0]), 0 * e[:, 0, 0]), "small", "work of the stress"),
    ],
)
def test_functions(function: Any, strain: Any, text: str) -> None:
    with pytest.raises(InputError, match=text):
        PointFunction(function, 1.0, strain)


def test_energies_that_see_rotations() -> None:
    import ufl

    with pytest.raises(InputError, match=r"turns with the body|symmetric stress"):
        Hyperelastic(lambda F, p: p["E"] * ufl.inner(F - ufl.Identity(3), F - ufl.Identity(3)), 1.0, {"E": 1e6})


ENERGIES: dict[str, tuple[Any, str]] = {
    "sign": (lambda F, p: -p["a"] * (0.5 * _square(F) - _ln(F) + _ln(F) ** 2), "every small strain raises"),
    "without volume": (lambda F, p: p["a"] * (_det(F) ** (-2 / 3) * _square(F) - 3), "every small strain raises"),
    "without shape": (lambda F, p: p["a"] * (_det(F) - 1) ** 2, "every small strain raises"),
    "under stress": (lambda F, p: p["a"] * (_square(F) - 3 + _ln(F) ** 2), "no stress at F = 1"),
    "of F F": (lambda F, p: p["a"] * _square(F * F - _unit()), "turns with the body"),
    "parameter": (lambda F, p: p["b"] * _square(F), r"p \(parameters: 'a'\), it raised KeyError"),
    "by NumPy": (lambda F, p: np.linalg.det(F), "in UFL.* it raised LinAlgError"),
    "index": (lambda F, p: F[3, 3], "indices 0 to 2"),
    "nothing": (lambda F, p: None, "in UFL"),
}


@pytest.mark.parametrize("name", ENERGIES)
def test_energies(name: str) -> None:
    energy, text = ENERGIES[name]
    with pytest.raises(InputError, match=text):
        Hyperelastic(energy, 1.0, {"a": 1e6})


def test_a_constant_in_an_energy_is_none() -> None:
    """Energies are counted from F = 1."""
    law = Hyperelastic(lambda F, p: p["a"] * (0.5 * _square(F) - _ln(F) + _ln(F) ** 2), 1.0, {"a": 1e6})
    at = Circumstances(np.zeros((1, 3)), 0.0, 0.0)
    assert law.respond(np.eye(3)[None], np.empty((1, 0)), at, False).energy[0] == 0.0


def _det(F: Any) -> Any:
    import ufl

    return ufl.det(F)


def _ln(F: Any) -> Any:
    import ufl

    return ufl.ln(ufl.det(F))


def _square(F: Any) -> Any:
    import ufl

    return ufl.inner(F, F)


def _unit() -> Any:
    import ufl

    return ufl.Identity(3)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_right_laws_in_any_unit(scale: float) -> None:
    import ufl

    def energy(l: Any, p: Any) -> Any:
        """Two terms of R. W. Ogden."""
        J = l[0] * l[1] * l[2]
        terms = [(p["a"], 1.8), (p["b"], -2.2)]
        return sum(2 * m / a**2 * (J ** (-a / 3) * sum(l[i] ** a for i in range(3)) - 3) for m, a in terms) + p["K"] * (J - 1 - ufl.ln(J))

    found = check_law(OfStretches(energy, 1.0, {"a": 6e5 * scale, "b": 1e5 * scale, "K": 1e8 * scale}))
    assert found.stress < 1e-7 and found.tangent < 1e-7 and found.symmetry < 1e-12

    def no_tension(e: np.ndarray, before: np.ndarray, at: Any) -> tuple[Any, ...]:
        """Stiff in compression only, axis by axis: kinks at zero."""
        stiff = scale * 1e9 * np.where(np.einsum("nii->ni", e) < 0, 1.0, 0.2)
        stress, tangent = np.zeros_like(e), np.zeros((len(e), 3, 3, 3, 3))
        for i in range(3):
            stress[:, i, i], tangent[:, i, i, i, i] = stiff[:, i] * e[:, i, i], stiff[:, i]
            for j in range(3):
                if i != j:
                    stress[:, i, j] = scale * 1e9 * e[:, i, j]
                    tangent[:, i, j, i, j] = tangent[:, i, j, j, i] = 0.5e9 * scale
        return stress, tangent, before

    PointFunction(no_tension, 1.0, "small", (Variable("nothing"),))
