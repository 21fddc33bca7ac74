"""Statics of bodies that supports do not hold: the mass that regularises them, what it is to be, what it carries."""
