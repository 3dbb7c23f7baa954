"""Solution of problems with a method: ``solve``, step-size control, dense output."""
