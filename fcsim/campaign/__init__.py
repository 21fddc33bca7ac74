"""Parameter studies: every combination is a run in a folder and a process of its own, with limits; one table of what came of them."""
