"""Bodies that turn: floating frames, their forces, the system matrix in them, and how far bodies turn and are strained."""
