"""Matrices of all bodies as a whole, for who reads their entries."""
