"""Bodies shared among ranks of MPI: whose they are, and how their owners' work comes together. See `fcsim.ranks`."""
