"""A university lab's pendulum as a Gymnasium environment.

Importing this package registers ``LabPendulum-v0`` and the other ids of :data:`pendulum_env.envs.limits.IDS`.
Compilers, plots and films are loaded when first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendulum_env.common.beside import import_fault
from pendulum_env.envs.limits import USUAL_ID, register

if _fault := import_fault():
    if Path(sys.argv[0]).stem in ("lab-pendulum", "-m"):  # commands print sentences, no tracebacks
        sys.exit(f"Error: {_fault}")
    raise ImportError(_fault)

if TYPE_CHECKING:
    from pendulum_env import adapters, bench, controllers, lab, plots, render, tasks, testing, web, window
    from pendulum_env.common.saved import load
    from pendulum_env.engine.code import code
    from pendulum_env.engine.result import Rollout
    from pendulum_env.engine.rollout import rollout
    from pendulum_env.envs.env import LabPendulumEnv
    from pendulum_env.envs.transfer import transfer
    from pendulum_env.envs.vector_env import LabPendulumVectorEnv
    from pendulum_env.films.record import film
    from pendulum_env.hard_cases.run import stress
    from pendulum_env.lab.fitting.fit import fit
    from pendulum_env.lab.recording import Recording
    from pendulum_env.lab.sensor import VirtualSensor
    from pendulum_env.lab.sheet import measure
    from pendulum_env.physics.presets import SCENES
    from pendulum_env.physics.scene import Run, Scene
    from pendulum_env.physics.sensor import Sensor
    from pendulum_env.physics.units import SceneError
    from pendulum_env.study.audit import audit, simplify
    from pendulum_env.study.basins import basins
    from pendulum_env.study.compare import compare
    from pendulum_env.study.cost import cost
    from pendulum_env.study.growth import growth
    from pendulum_env.study.section import section
    from pendulum_env.study.study import Study
    from pendulum_env.study.sweep import Sweep, sweep
    from pendulum_env.tasks import Task

__version__: str  # asked for when it is wanted

ENV_ID = USUAL_ID
"""Id of the environment for ``gym.make``. A change of physics or defaults that alters trajectories adds a v1; v0 stays.
"""

_LAZY = {
    "LabPendulumEnv": "pendulum_env.envs.env",
    "LabPendulumVectorEnv": "pendulum_env.envs.vector_env",
    "Recording": "pendulum_env.lab.recording",
    "Rollout": "pendulum_env.engine.result",
    "Run": "pendulum_env.physics.scene",
    "SCENES": "pendulum_env.physics.presets",
    "Scene": "pendulum_env.physics.scene",
    "SceneError": "pendulum_env.physics.units",
    "Sensor": "pendulum_env.physics.sensor",
    "audit": "pendulum_env.study.audit",
    "basins": "pendulum_env.study.basins",
    "code": "pendulum_env.engine.code",
    "compare": "pendulum_env.study.compare",
    "cost": "pendulum_env.study.cost",
    "film": "pendulum_env.films.record",
    "fit": "pendulum_env.lab.fitting.fit",
    "growth": "pendulum_env.study.growth",
    "load": "pendulum_env.common.saved",
    "measure": "pendulum_env.lab.sheet",
    "rollout": "pendulum_env.engine.rollout",
    "section": "pendulum_env.study.section",
    "Study": "pendulum_env.study.study",
    "Sweep": "pendulum_env.study.sweep",
    "Task": "pendulum_env.tasks",
    "VirtualSensor": "pendulum_env.lab.sensor",
    "simplify": "pendulum_env.study.audit",
    "stress": "pendulum_env.hard_cases.run",
    "sweep": "pendulum_env.study.sweep",
    "transfer": "pendulum_env.envs.transfer",
}
"""Public names that are imported on first use, and their modules."""
_ROOMS = ("adapters", "bench", "controllers", "lab", "plots", "render", "tasks", "testing", "web", "window")
"""Rooms with public names of their own, which are imported on first use."""
_WITH_EXTRAS = {"jax": "jax"}
"""Further such rooms, and the package of an extra without which they cannot be imported."""

__all__ = [
    "ENV_ID",
    "SCENES",
    "LabPendulumEnv",
    "LabPendulumVectorEnv",
    "Recording",
    "Rollout",
    "Run",
    "Scene",
    "SceneError",
    "Sensor",
    "Study",
    "Sweep",
    "Task",
    "VirtualSensor",
    "adapters",
    "audit",
    "basins",
    "bench",
    "code",
    "compare",
    "controllers",
    "cost",
    "film",
    "fit",
    "growth",
    "lab",
    "load",
    "measure",
    "plots",
    "render",
    "rollout",
    "section",
    "simplify",
    "stress",
    "sweep",
    "tasks",
    "testing",
    "transfer",
    "web",
    "window",
]


def __getattr__(name: str) -> Any:
    if name in _ROOMS or name in _WITH_EXTRAS:
        return import_module(f"pendulum_env.{name}")
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    if name == "__version__":
        from pendulum_env.common.version import version

        return version()
    raise AttributeError(f"module 'pendulum_env' has no attribute '{name}'")


def __dir__() -> list[str]:
    """List the public names, and no others: those of ``__all__``, and rooms whose extra is installed."""
    there = (name for name, package in _WITH_EXTRAS.items() if find_spec(package))
    return sorted({"__all__", "__doc__", "__file__", "__name__", "__path__", "__version__", *__all__, *there})


register()
