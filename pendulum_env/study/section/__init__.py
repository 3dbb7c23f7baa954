"""Poincaré sections of driven scenes: attractors, bifurcation diagrams and basins of attraction."""

from pendulum_env.common.results import write
from pendulum_env.study.section.basins import Basins, basins
from pendulum_env.study.section.study import Section, section

__all__ = ["Basins", "Section", "basins", "section", "write"]
