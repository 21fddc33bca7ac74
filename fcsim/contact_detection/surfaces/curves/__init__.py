"""Surfaces that facets stand for: which facets are chords of a curve, and its normals at their vertices."""
