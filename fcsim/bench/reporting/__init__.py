"""What a bench says: tables, profiles, convergence, one page."""
