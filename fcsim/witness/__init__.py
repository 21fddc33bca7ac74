"""The witness of penetration: the bodies' true overlap, independent of contact detection."""

from fcsim.witness.overlap import Overlap
from fcsim.witness.witness import Watch, Witness, begin, penetration_seen

__all__ = ["Overlap", "Watch", "Witness", "begin", "penetration_seen"]
