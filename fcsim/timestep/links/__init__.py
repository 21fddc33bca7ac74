"""Links in a step of time: their rows, and what they did."""
