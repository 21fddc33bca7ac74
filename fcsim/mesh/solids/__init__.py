"""Solids given by their surfaces, that nobody meshed: polyhedra of polygons, plates within polygons."""
