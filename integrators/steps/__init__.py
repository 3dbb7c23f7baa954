"""Building blocks of generated steps: expressions, Newton iterations, compensated sums, error estimates."""
