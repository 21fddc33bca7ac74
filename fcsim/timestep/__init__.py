"""From one state to the next: schemes, the step, its energy, the simulation as an iterator of steps."""
