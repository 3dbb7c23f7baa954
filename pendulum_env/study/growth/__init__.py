"""How errors grow over very many periods."""

from pendulum_env.study.growth.study import growth

__all__ = ["growth"]
