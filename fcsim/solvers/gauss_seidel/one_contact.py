"""The table of one-contact solvers that Gauss-Seidel methods on reactions and on velocities share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import FunctionType
from typing import TYPE_CHECKING

from fcsim.solvers.gauss_seidel import _conjugate_kernels
from fcsim.solvers.gauss_seidel import _one_contact_exact as exact
from fcsim.solvers.gauss_seidel import _one_contact_kernels as kernels
from fcsim.solvers.gauss_seidel import _sweep_kernels as _kernels

if TYPE_CHECKING:
    from numba.core.dispatcher import Dispatcher


@dataclass(frozen=True)
class OneContact:
    """A compiled one-contact solver (signature: `_one_contact_kernels`), its rule for rho (a name of `scaling`), its Siconos name."""

    name: str
    kernel: Dispatcher
    rho: str
    siconos: str

    @property
    def _function(self) -> str:
        """The name of the solver's Python function, which NUMBA_DISABLE_JIT=1 leaves as it is."""
        function: object = getattr(self.kernel, "py_func", self.kernel)
        assert isinstance(function, FunctionType)
        return function.__name__

    @cached_property
    def sweep(self) -> Dispatcher:
        """`_kernels.sweep` with this solver."""
        return _kernels.compiled(_kernels.sweep, self._function, self.kernel)

    @cached_property
    def sweep_conjugate(self) -> Dispatcher:
        """`_conjugate_kernels.sweep_conjugate` with this solver's sweep."""
        return _conjugate_kernels.compiled(self._function, self.sweep)

    @cached_property
    def sweep_velocities(self) -> Dispatcher:
        """`_kernels.sweep_velocities` with this solver."""
        return _kernels.compiled(_kernels.sweep_velocities, self._function, self.kernel)


_SPLIT, _SPECTRAL = "split spectral norm", "spectral norm"

ONE_CONTACT: dict[str, OneContact] = {
    solver.name: solver
    for solver in (
        OneContact("AC", kernels.newton_alart_curnier, _SPLIT, "ONECONTACT_NSN"),
        OneContact("JM", kernels.newton_jean_moreau, _SPLIT, "ONECONTACT_NSN"),
        OneContact("AC-GP", kernels.newton_alart_curnier_damped, _SPLIT, "ONECONTACT_NSN_GP"),
        OneContact("JM-GP", kernels.newton_jean_moreau_damped, _SPLIT, "ONECONTACT_NSN_GP"),
        OneContact("AC-GP-HYBRID", kernels.newton_alart_curnier_hybrid, _SPLIT, "ONECONTACT_NSN_GP_HYBRID"),
        OneContact("JM-GP-HYBRID", kernels.newton_jean_moreau_hybrid, _SPLIT, "ONECONTACT_NSN_GP_HYBRID"),
        OneContact("FP-DS-ONE", kernels.project_once, _SPECTRAL, "ONECONTACT_ProjectionOnCone"),
        OneContact("FP-DS", kernels.project_de_saxce, _SPECTRAL, "ONECONTACT_ProjectionOnConeWithLocalIteration"),
        OneContact("FP-VI-UPK", kernels.project_self_adaptive, _SPECTRAL, ""),
        OneContact("PC-DIAG", kernels.project_in_diagonal_metric, _SPLIT, "ONECONTACT_ProjectionOnConeWithDiagonalization"),
        OneContact("CYL", kernels.project_cylinder_once, _SPLIT, "ONECONTACT_ProjectionOnCylinder"),
        OneContact("CYL-LOCAL", kernels.project_cylinder, _SPLIT, "ONECONTACT_ProjectionOnCylinderWithLocalIteration"),
        OneContact("EXACT", exact.enumerate_cases, _SPLIT, "ONECONTACT_QUARTIC"),
        OneContact("NCP-FB", exact.glocker_newton, _SPLIT, "NCPGlockerFBNewton"),
        OneContact("NCP-FP", exact.glocker_fixed_point, _SPLIT, "NCPGlockerFBFixedPoint"),
    )
}
