"""Two-minute tour of the package, with a controlled run as its last chapter."""

from pendulum_env.study.demo.tour import Chapter, demo

__all__ = ["Chapter", "demo"]
