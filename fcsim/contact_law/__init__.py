"""What happens where bodies touch: the laws of contact and friction."""

from fcsim.contact_law.coulomb import Gap, Velocity

__all__ = ["Gap", "Velocity"]
