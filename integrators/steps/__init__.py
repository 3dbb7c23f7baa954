"""Shared parts of the source of steps: expressions, Newton iterations, compensated sums, error estimates."""
