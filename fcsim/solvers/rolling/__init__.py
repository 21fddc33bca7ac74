"""Methods for contact with rolling and spinning friction, on the cone of five or six dimensions."""
