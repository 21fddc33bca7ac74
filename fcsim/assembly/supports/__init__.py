"""Supports: which degrees of freedom are held or driven, along which axes, and how fast."""

from fcsim.assembly.supports.axes import DofAxes
from fcsim.assembly.supports.held import HeldDofs, held_dofs
from fcsim.assembly.supports.support import DrivenRotation, Support, TimeFunction

__all__ = ["DofAxes", "DrivenRotation", "HeldDofs", "Support", "TimeFunction", "held_dofs"]
