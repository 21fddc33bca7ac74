"""Curved surfaces that straight facets stand for: which facets are chords of a curve, its normals, and its height over them."""
