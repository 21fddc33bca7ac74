"""Linear complementarity: in the plane and with faceted cones."""
