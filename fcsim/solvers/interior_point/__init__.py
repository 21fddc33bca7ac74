"""Interior points: the algebra of their cones, and Coulomb's law by a primal-dual method."""
