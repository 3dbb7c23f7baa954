"""Helpers without physics: argument checks, files, warnings, progress bars, text tables."""
