"""What platform and arm are asked to do: references, arm motions, and what shapes them."""
