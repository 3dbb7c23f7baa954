"""The tour in two minutes, and the controlled run of its last chapter."""

from pendulum_env.study.demo.tour import Chapter, demo

__all__ = ["Chapter", "demo"]
