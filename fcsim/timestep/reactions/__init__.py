"""Reactions of earlier steps at the contacts of later ones, and where a solver begins with them."""
