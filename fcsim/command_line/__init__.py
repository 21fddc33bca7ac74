"""The command `fcsim`."""
