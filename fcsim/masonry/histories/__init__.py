"""Structures on their way: pushed by displacement, on ground that shakes, on supports that give way."""
