"""Contact integrated over the overlaps of two surfaces: mortar and segments."""
