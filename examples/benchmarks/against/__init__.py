"""Parts of the benchmark :mod:`precision`: problem, reference solution, solvers of each package, and reports."""
