"""Contact detection, node-to-segment and integral: from positions to contacts, and from contacts to the matrix H."""

from fcsim.contact_detection.broad_phase import PairList
from fcsim.contact_detection.contact_matrix import contact_matrix
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.detect import Detector
from fcsim.contact_detection.sharp_edges import split_at_sharp_edges
from fcsim.contact_detection.surface import ContactSurface, SurfacePair, two_pass

__all__ = ["ContactSurface", "Contacts", "Detector", "PairList", "SurfacePair", "contact_matrix", "split_at_sharp_edges", "two_pass"]
