"""Matrices whose entries are made when they are first read."""
