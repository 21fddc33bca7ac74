"""Running a case: its script, its folder of results, its sensors, tables, checkpoints and series of files."""
