"""Old module paths of version 0.1, which scripts, saved specs and pickles may contain, and their new paths."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

MOVED = {f"pendulum_env.{old}": f"pendulum_env.{new}" for old, new in {
    "action": "tasks.action",
    "api_pages": "cli.api_pages",
    "cameras": "envs.cameras",
    "catalogue": "study.lists.tables",
    "controllers.random_policy": "controllers.policy",
    "effect_list": "study.lists.effects",
    "engine.certified_many": "engine.certified",
    "engine.trajectory": "engine.machine",
    "env": "envs.env",
    "lab.fitting.choice": "lab.fitting.result",
    "lab.fitting.sampling": "lab.fitting.intervals",
    "lab.report": "study.fit_report",
    "method_list": "study.lists.methods",
    "picture": "films.picture",
    "reel": "films.reel",
    "render.look": "render.stage",
    "settings": "envs.settings",
    "streams": "engine.streams",
    "study.compare.truth": "truth.reference",
    "study.cost_plot": "plots.cost",
    "study.cost_points": "study.cost.points",
    "study.films": "films.runs",
    "study.growth_laws": "study.growth.laws",
    "study.growth_plot": "plots.growth",
    "study.hard_cases": "hard_cases",
    "study.hard_cases.case": "hard_cases.case",
    "study.hard_cases.catalogue": "hard_cases.catalogue",
    "study.hard_cases.run": "hard_cases.run",
    "study.record": "films.record",
    "study.reference": "truth.reference",
    "study.simplify": "study.audit.simplification",
    "study.summary": "study.sweep.summary",
    "study.verdicts": "study.audit.verdicts",
    "truth.compared": "truth.reference",
    "truth.long_steps": "truth.steps",
    "truth.own_error": "truth.steps",
    "truth.phase": "truth.reference",
    "truth.stiff_damping": "truth.steps",
    "vector_env": "envs.vector_env",
    "window.pace": "window.live",
}.items()}


class OldPathsHere:
    """Importer that finds this package's modules by their old paths.

    The importer of :mod:`integrators.moved`, which does the work, is loaded only when an old path is imported.
    """

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None,
                  ) -> ModuleSpec | None:
        """Return the import system's module spec if ``name`` is the old path of a moved module, else None."""
        if name not in MOVED:
            return None
        from integrators.moved import OldPaths

        return OldPaths(MOVED).find_spec(name, path, target)


def keep_old_paths() -> None:
    """Make all modules that have moved since version 0.1 importable by their old paths as well."""
    sys.meta_path.append(OldPathsHere())
