"""The two-level system where ranks of MPI have W together: each has some joints, and the shares of its own bodies."""
