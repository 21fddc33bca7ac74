"""W known by the bodies it is summed of."""
