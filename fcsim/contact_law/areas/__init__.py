"""The area that a contact stands for, where the facets of two bodies overlap."""
