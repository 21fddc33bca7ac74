"""fcsim cases | new | doctor | completion: what a newcomer begins with."""
