"""Frames and films of runs."""
