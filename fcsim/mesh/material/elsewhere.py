"""The hook for materials written elsewhere: a NumPy function of strain and internal variables at any number of points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.mesh.material.check import refuse_wrong
from fcsim.mesh.material.law import Circumstances, Response, Variable, refuse_density


@dataclass(frozen=True)
class PointFunction:
    """A material by `function(strain, before, at) -> (stress, tangent, after)` or `(stress, tangent, after, energy, dissipated)`.

    strain (n, 3, 3): F for "finite", eps for "small"; before, after (n, k): internal variables, components in the order of `variables`;
    at: see `Circumstances`; stress (n, 3, 3) P or sigma, tangent (n, 3, 3, 3, 3); energy, dissipated (n,), see `Response` (without them the
    balance of energy books all work as dissipated by the scheme). `check_law` compares the three by finite differences.
    """

    function: Callable[[FloatArray, FloatArray, Circumstances], tuple[ArrayLike, ...]]
    density: float
    strain: Literal["finite", "small"] = "finite"
    variables: tuple[Variable, ...] = ()

    def __post_init__(self) -> None:
        refuse_density("PointFunction", self.density)
        if self.strain not in ("finite", "small"):
            raise InputError(f"PointFunction, strain: expected 'finite' or 'small', got {self.strain!r}")
        if not callable(self.function):
            raise InputError(f"PointFunction, function: expected a function of (strain, before, at), got {self.function!r}")
        refuse_wrong(self, "PointFunction, function")

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        n = len(strain)
        answer = self.function(strain, before, at)
        if not isinstance(answer, tuple) or len(answer) not in (3, 5):
            raise InputError(
                "PointFunction, function: expected (stress, tangent, after) or (stress, tangent, after, energy, dissipated), got "
                f"{type(answer).__name__}{f' of {len(answer)}' if isinstance(answer, tuple) else ''}"
            )
        shapes = ((n, 3, 3), (n, 3, 3, 3, 3), before.shape, (n,), (n,))
        names = ("stress", "tangent", "after", "energy", "dissipated")
        arrays = [np.asarray(a, dtype=float) for a in (*answer, *[np.zeros(n)] * (5 - len(answer)))]
        for name, array, shape in zip(names, arrays, shapes, strict=True):
            if array.shape != shape:
                raise InputError(f"PointFunction, {name}: expected shape {shape} for {n} points, got {array.shape}")
        return Response(arrays[0], arrays[1] if tangent else None, arrays[3], arrays[4], arrays[2])
