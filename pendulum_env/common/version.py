"""Version of the package, which the build tool hatchling reads from this file."""

__version__ = "0.1.0"

REGISTERED = 500
"""Number of control steps of an episode that LabPendulum-v0 is registered with."""
