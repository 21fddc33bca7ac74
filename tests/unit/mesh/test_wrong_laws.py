"""A user's mistakes in a material are answered by one error that names them; materials that are right are not refused."""

from typing import Any

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.material import Hyperelastic, Material, OfStretches, PointFunction, Variable, check_law
from fcsim.mesh.material.law import as_tensor

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
    ],
)
def test_functions(function: Any, strain: Any, text: str) -> None:
    with pytest.raises(InputError, match=text):
        PointFunction(function, 1.0, strain)


def test_energies_that_see_rotations() -> None:
    import ufl

    with pytest.raises(InputError, match=r"turns with the body|symmetric stress"):
        Hyperelastic(lambda F, p: p["E"] * ufl.inner(F - ufl.Identity(3), F - ufl.Identity(3)), 1.0, {"E": 1e6})


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
