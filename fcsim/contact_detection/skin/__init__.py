"""The closed surfaces of all bodies: boundary facets, who borders whom, and their shape at given positions."""
