"""Rigid bodies whose shape is a formula: spheres, capsules, cylinders, planes."""
