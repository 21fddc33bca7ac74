"""How the linearisations of a step follow each other: in one loop with the contacts, or mixed; when they have arrived."""
