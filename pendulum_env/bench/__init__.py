"""Live samples of sensors: :func:`acquire` and the sources it reads."""
