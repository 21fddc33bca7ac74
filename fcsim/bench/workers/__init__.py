"""Each solve of a bench in a process of its own, with limits; Siconos beside."""
