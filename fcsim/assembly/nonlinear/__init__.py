"""Bodies of nonlinear materials: inner forces, tangents, energies and internal variables from the laws of points."""
