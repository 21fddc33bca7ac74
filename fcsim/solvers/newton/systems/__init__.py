"""Ways to solve A (W + D) + B, the linear system of a Newton step; `choice` decides which one serves."""
