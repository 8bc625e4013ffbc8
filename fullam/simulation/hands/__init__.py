"""What hands do to a flight: targets, pushes, exchanged parts, and the way back to a moment."""
