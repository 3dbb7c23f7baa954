"""What there is to choose from: scenes, integrators, effects and tasks as lists and tables."""
