"""The methods that everybody knows."""

PLAIN = ("forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4")
"""Those of the lab exercise, and the two in most use: compared by default, and always in colour."""
