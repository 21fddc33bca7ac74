"""What a run says of itself besides its numbers: `opening`, before its first step; and what it refuses to begin with: `arguments`."""
