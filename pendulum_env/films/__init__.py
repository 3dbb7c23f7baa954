"""From a run to frames to files."""
