"""How deep bodies overlap: contacts where neither vertices nor crossing edges tell, and none that is deeper than two convex bodies do."""
