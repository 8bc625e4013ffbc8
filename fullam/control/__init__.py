"""What the vehicle is told: controllers (pose to wrench) and allocation (wrench to rotors)."""
