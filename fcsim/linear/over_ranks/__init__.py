"""Matrices that ranks of MPI have together: each some rows, one factor by all, products in the place of entries."""
