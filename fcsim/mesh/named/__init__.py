"""Nodes and surfaces of a part that users name."""
