"""Surfaces of contact: their facets, candidate points, projections and possible neighbours."""
