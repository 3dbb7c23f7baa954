"""Studies that compare integrators, measure the cost of accuracy and show which effects of a scene matter."""

PLAIN = ("forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4")
"""Integrators that `compare` takes by default and that plots draw in colour: the lab exercise's, Verlet and RK4."""
