"""What is asked of sparse matrices in every step, at once from their arrays: SciPy makes a matrix of the transposed one first."""
