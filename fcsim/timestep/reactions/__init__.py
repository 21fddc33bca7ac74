"""What earlier steps leave for later ones: reactions at their contacts, where a solver begins, and the motion that is expected."""
