"""Nonsmooth Gauss-Seidel: sweeps over the contacts, each solved alone."""
