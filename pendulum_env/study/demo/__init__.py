"""The tour in two minutes."""
