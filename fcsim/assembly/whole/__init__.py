"""All bodies as a whole: their matrices for who reads entries, and what ranks keep of them once."""
