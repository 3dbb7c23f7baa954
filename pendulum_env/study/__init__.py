"""Studies: several methods compared, what accuracy costs, which effects matter."""

PLAIN = ("forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4")
"""Methods of the lab exercise, and the two in most use: compared by default, and always in colour."""
