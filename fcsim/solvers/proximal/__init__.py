"""The proximal point algorithm: options and the rules of alpha, its steps, the problems inside."""
