"""Parts whose operators ranks of MPI have together, each some rows of them."""
