"""The simulated physics: apparatus, medium, effects and scenes, in plain Python on floats."""
