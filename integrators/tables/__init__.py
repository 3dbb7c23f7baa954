"""Tables of the methods' coefficients, one module per family."""
