"""Factors of matrices by blocks on their elimination tree, with many small fronts, compiled."""
