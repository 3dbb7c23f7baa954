"""Fit a scene to a recording: parameters with uncertainties, and a comparison of damping models."""
