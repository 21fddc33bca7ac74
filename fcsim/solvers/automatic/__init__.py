"""`auto`: chooses and chains methods from the problem itself."""
