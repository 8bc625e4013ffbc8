"""How the vehicle moves: the paper's equations, their witness, and integrators."""
