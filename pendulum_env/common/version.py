"""Version of the package, which the build tool hatchling reads from this file."""

__version__ = "0.1.0"
