"""Contact detection, of everything or of listed pairs: from positions to contacts, and from contacts to the matrix H."""

from fcsim.contact_detection.contact_matrix import contact_matrix, contact_matrix_of_bodies
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.detection import Detection, innermost, left_out
from fcsim.contact_detection.detector import Detector
from fcsim.contact_detection.exact import ExactContacts
from fcsim.contact_detection.general.everything import Everything
from fcsim.contact_detection.surfaces.sharp_edges import split_at_sharp_edges
from fcsim.contact_detection.surfaces.surface import ContactSurface, SurfacePair, two_pass

__all__ = [
    "ContactSurface",
    "Contacts",
    "Detection",
    "Detector",
    "Everything",
    "ExactContacts",
    "SurfacePair",
    "contact_matrix",
    "contact_matrix_of_bodies",
    "innermost",
    "left_out",
    "split_at_sharp_edges",
    "two_pass",
]
