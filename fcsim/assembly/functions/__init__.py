"""Back to dolfinx: functions of the state of a body."""
