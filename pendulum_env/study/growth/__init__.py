"""Study of how integration errors grow over very many periods."""

from pendulum_env.common.results import write
from pendulum_env.study.growth.study import Growth, GrowthLine, growth

__all__ = ["Growth", "GrowthLine", "growth", "write"]
