"""Multifrontal LU of A W + B by block rows."""
