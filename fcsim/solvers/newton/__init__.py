"""Nonsmooth Newton methods: formulations, line searches, iterations and the linear systems of their steps."""
