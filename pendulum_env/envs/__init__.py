"""Gymnasium environments of one pendulum, and of many pendulums at once."""
