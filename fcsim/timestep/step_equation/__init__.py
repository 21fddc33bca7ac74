"""The equation of one step and its answer: linearised elastic forces, compliances, a sequence of friction problems."""
