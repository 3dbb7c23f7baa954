"""What :mod:`precision` is made of: the problem, its truth, one file of solvers for each peer, and what follows."""
