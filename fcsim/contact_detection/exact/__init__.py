"""Exact contactors: bodies whose shape is a formula, not facets."""

from fcsim.contact_detection.exact.exact_contacts import ExactContacts

__all__ = ["ExactContacts"]
