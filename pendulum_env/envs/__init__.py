"""The environments behind Gymnasium's interfaces: one pendulum, and many at once."""
