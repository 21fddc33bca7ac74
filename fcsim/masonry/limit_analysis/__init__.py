"""Limit analysis: equilibrium of blocks, programs, both laws of slip, the joints of a mechanism."""
