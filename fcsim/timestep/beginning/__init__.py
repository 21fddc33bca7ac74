"""What happens before the first contacts are held: what would pass is seen, what begins into each other is struck."""
