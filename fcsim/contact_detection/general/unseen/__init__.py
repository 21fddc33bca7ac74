"""Bodies that overlap although neither vertices nor crossing edges say so."""
