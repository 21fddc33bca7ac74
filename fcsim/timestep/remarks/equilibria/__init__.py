"""What is said of equilibria: those that a body would leave, and those that it has left for another."""
