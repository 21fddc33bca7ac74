"""What writes the files of a run beside its steps."""
