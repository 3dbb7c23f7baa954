"""Module paths of version 0.1 that users may have in scripts, saved specs and pickles, and the paths of today."""

from __future__ import annotations

MOVED = {f"pendulum_env.{old}": f"pendulum_env.{new}" for old, new in {
    "action": "tasks.action",
    "api_pages": "cli.api_pages",
    "catalogue": "study.lists.tables",
    "effect_list": "study.lists.effects",
    "engine.certified_many": "engine.certified",
    "engine.trajectory": "engine.machine",
    "env": "envs.env",
    "method_list": "study.lists.methods",
    "settings": "envs.settings",
    "study.cost_plot": "study.cost.plot",
    "study.cost_points": "study.cost.points",
    "study.films": "films.runs",
    "study.growth_laws": "study.growth.laws",
    "study.growth_plot": "study.growth.plot",
    "study.hard_cases": "hard_cases",
    "study.hard_cases.case": "hard_cases.case",
    "study.hard_cases.catalogue": "hard_cases.catalogue",
    "study.hard_cases.run": "hard_cases.run",
    "study.record": "films.record",
    "study.reference": "truth.reference",
    "study.simplify": "study.audit.simplification",
    "study.summary": "study.sweep.summary",
    "study.verdicts": "study.audit.verdicts",
    "vector_env": "envs.vector_env",
}.items()}
