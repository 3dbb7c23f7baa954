"""Running a method on a problem: solve, step-size control, dense output."""
