"""Linear algebra of the core: factors of sparse and dense matrices, block rows, elimination of block-sparse W, Krylov methods."""
