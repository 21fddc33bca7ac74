"""The version, in the ground: rooms that write it into files do not load the face of the package for it."""

__version__ = "0.2.0"
