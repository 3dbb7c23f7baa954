"""Lists and tables of the available scenes, integrators, effects and tasks."""
