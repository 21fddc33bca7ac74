"""fcsim limit | tilt | push | shake: structures of blocks."""
