"""Methods for the variational inequality: projections, splitting, convex programs and their fixed points."""
