"""What happens where bodies touch: the laws of contact and friction, and what they remember."""

from fcsim.contact_law.cohesive import Cohesive, JointLost
from fcsim.contact_law.compliant import Compliant, Springs
from fcsim.contact_law.coulomb import Gap, Velocity
from fcsim.contact_law.friction import Elliptic, RateDependent, Sliding, SlipWeakening, StaticKinetic
from fcsim.contact_law.law import Law, Meeting, Outcome, Remembered, Terms, Timing, Variables
from fcsim.contact_law.rolling import Rolling, Spinning
from fcsim.contact_law.table import LawTable, laws_of_bodies, laws_of_pairs

__all__ = [
    "Cohesive",
    "Compliant",
    "Elliptic",
    "Gap",
    "JointLost",
    "Law",
    "LawTable",
    "Meeting",
    "Outcome",
    "RateDependent",
    "Remembered",
    "Rolling",
    "Sliding",
    "SlipWeakening",
    "Spinning",
    "Springs",
    "StaticKinetic",
    "Terms",
    "Timing",
    "Variables",
    "Velocity",
    "laws_of_bodies",
    "laws_of_pairs",
]
