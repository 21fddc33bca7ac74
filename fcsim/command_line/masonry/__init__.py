"""fcsim limit | tilt | push | shake | settle | atlas: structures of blocks."""
