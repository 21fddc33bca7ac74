"""Cells of second order: raised from first order, and the linear facets that stand for their curved ones."""
