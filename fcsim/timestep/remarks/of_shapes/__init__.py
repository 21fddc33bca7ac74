"""Remarks on what the shapes of bodies and their facets do to contact."""
