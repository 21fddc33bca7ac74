"""From parts with materials to one model: mass, damping, stiffness, supports and loads."""
