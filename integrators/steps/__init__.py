"""What families share to write a step: expressions, Newton iterations, compensated sums, error estimates."""
