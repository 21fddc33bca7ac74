"""What a VTK series is made of: the collection that lists its files, bodies, points, and the units in the names of their arrays."""
