"""Supports: which degrees of freedom are held or driven, along which axes, and how fast."""

from fcsim.assembly.supports.axes import DofAxes
from fcsim.assembly.supports.held import HeldDofs, held_dofs
from fcsim.assembly.supports.support import DrivenRotation, Support, TimeFunction
from fcsim.assembly.supports.together import moved_together

__all__ = ["DofAxes", "DrivenRotation", "HeldDofs", "Support", "TimeFunction", "held_dofs", "moved_together"]
