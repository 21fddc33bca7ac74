"""How contact forces and gaps change as bodies move: geometric stiffness by formulas and by differences, gaps that lean."""
