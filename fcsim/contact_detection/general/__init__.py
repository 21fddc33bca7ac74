"""Contact of everything with everything: complete detection between closed surfaces, by vertices, edges and faces."""
