"""W as the sum of the bodies' shares, where that is known beside W itself."""
