"""An energy in UFL and its first two derivatives, compiled by ffcx."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from fcsim import runtime
from fcsim.arrays import FloatArray, is_number
from fcsim.brief import shown
from fcsim.errors import InputError, MissingDependency
from fcsim.mesh.material._compiled_kernels import tabulate

if TYPE_CHECKING:
    from ufl.core.expr import Expr


class CompiledEnergy:
    """W(z; p) of a UFL coefficient z with `shape` and of numbers p, with dW/dz and the upper triangle of d2W/dz2."""

    def __init__(self, energy: Callable[..., Expr], names: tuple[str, ...], shape: tuple[int, ...]) -> None:
        runtime.dolfinx()
        import basix.ufl
        import ufl
        from cffi import VerificationError
        from dolfinx.jit import ffcx_jit
        from mpi4py import MPI

        mesh = ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)))
        z = ufl.variable(ufl.Coefficient(ufl.FunctionSpace(mesh, basix.ufl.element("DG", "interval", 0, shape=shape))))
        numbers = ufl.Constant(mesh, shape=(max(len(names), 1),))
        W = _asked(energy, z, {name: numbers[k] for k, name in enumerate(names)})
        if W.ufl_shape != ():
            raise InputError(f"energy: expected a scalar in UFL, got one of shape {W.ufl_shape}")
        first = ufl.diff(W, z)
        second = ufl.diff(first, z)
        places = list(np.ndindex(shape))
        self.size = len(places)
        values = [W, *(first[i] for i in places)]
        values += [second[(*places[a], *places[b])] for a in range(self.size) for b in range(a, self.size)]
        try:
            self._kept = ffcx_jit(MPI.COMM_SELF, (ufl.as_vector(values), np.array([[0.5]])))
        except VerificationError as error:
            raise MissingDependency(
                f"energies are compiled with a C compiler, and this one failed ({error}): install one (on Debian: apt-get install gcc "
                "libc6-dev) or name it in the environment variable CC"
            ) from error
        compiled, module = self._kept[0], self._kept[1]
        self._address = int(module.ffi.cast("intptr_t", compiled.tabulate_tensor_float64))
        # constants that the energy does not use are not passed on by ffcx: then there are none at all, since all are one vector
        self._count = len(values)

    def __call__(self, z: FloatArray, numbers: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """W (n,), dW/dz (n, k), d2W/dz2 (n, k, k) for z (n, k)."""
        out, k = np.empty((len(z), self._count)), self.size
        tabulate(self._address, np.ascontiguousarray(z, dtype=np.float64), np.append(numbers, 0.0), out)
        rows, columns = np.triu_indices(k)
        second = np.empty((len(z), k, k))
        second[:, rows, columns] = out[:, 1 + k :]
        second[:, columns, rows] = out[:, 1 + k :]
        return out[:, 0], out[:, 1 : 1 + k], second


def _asked(energy: Callable[..., Expr], z: Expr, numbers: Mapping[str, Expr]) -> Expr:
    import ufl

    try:
        return ufl.as_ufl(energy(z, numbers))
    except Exception as error:  # whatever UFL and a user's function raise
        known = ", ".join(map(repr, numbers)) or "none"
        raise InputError(
            f"energy: expected a scalar in UFL (ufl.ln, ufl.det, ...) of a measure of strain with indices 0 to {z.ufl_shape[0] - 1} and of "
            f"p (parameters: {known}), it raised {type(error).__name__}: {error}"
        ) from error


_COMPILED: dict[tuple[Hashable, ...], CompiledEnergy] = {}


def compiled(energy: Callable[..., Expr], names: tuple[str, ...], shape: tuple[int, ...]) -> CompiledEnergy:
    """The compiled energy; one and the same for materials that share the function and the names of its numbers."""
    key = (energy, names, shape)
    if key not in _COMPILED:
        _COMPILED[key] = CompiledEnergy(energy, names, shape)
    return _COMPILED[key]


def checked_numbers(what: str, parameters: Mapping[str, float]) -> None:
    """Refuse parameters that are no finite numbers."""
    for name, value in parameters.items():
        if not is_number(value):
            raise InputError(f"{what}, parameters[{name!r}]: expected a finite number, got {shown(value)}")
