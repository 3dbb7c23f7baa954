"""Fitting a scene to a recording: its parameters with uncertainties, and the damping that the data call for."""
