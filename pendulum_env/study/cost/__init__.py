"""Work-precision studies: the computing time that an accuracy costs, for many integrators."""

from pendulum_env.study.cost.points import CostPoint, CostStudy
from pendulum_env.study.cost.study import cost

__all__ = ["CostPoint", "CostStudy", "cost"]
