"""Logs of a driven pendulum: reading them, and fitting motor, friction, delay and sensor to several at once."""
