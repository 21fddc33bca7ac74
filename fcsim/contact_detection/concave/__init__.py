"""Surfaces that are concave: points that more than one facet holds."""
