"""A front door for problems of few contacts: one compiled call where the general way would take longer than the method itself."""
