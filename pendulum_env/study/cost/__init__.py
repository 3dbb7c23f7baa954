"""What accuracy costs in time: work-precision studies."""

from pendulum_env.study.cost.points import CostStudy
from pendulum_env.study.cost.study import cost

__all__ = ["CostStudy", "cost"]
