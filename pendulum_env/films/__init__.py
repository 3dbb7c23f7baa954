"""Frames (pictures) and films of simulated runs."""
