"""What is refused before a run touches anything: folders that are not its own, sizes that no memory holds."""
