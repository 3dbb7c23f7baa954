"""Audit of a scene: which of its physical effects (drag, buoyancy and others) matter at a wanted accuracy."""

from pendulum_env.study.audit.study import audit, simplify
from pendulum_env.study.audit.verdicts import Audit, AuditRow, Simplification

__all__ = ["Audit", "AuditRow", "Simplification", "audit", "simplify"]
