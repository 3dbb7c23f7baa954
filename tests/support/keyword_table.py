"""Every public function, and a call of each that works, in which one keyword after the other is spoilt."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

import integrators
import pendulum_env
from pendulum_env import (
    SCENES,
    LabPendulumEnv,
    LabPendulumVectorEnv,
    Recording,
    Sweep,
    VirtualSensor,
    bench,
    controllers,
    lab,
    sweep,
    tasks,
    testing,
)
from pendulum_env.auto.choice import choose
from pendulum_env.hard_cases.run import stress
from pendulum_env.physics import effects, exact
from pendulum_env.physics.bodies import BODIES
from pendulum_env.physics.damping import build_scene, parse_damping, parse_settings, with_damping
from pendulum_env.physics.medium import MEDIA, Medium
from pendulum_env.physics.presets import find_scene
from pendulum_env.study import compare
from pendulum_env.study.demo import demo
from pendulum_env.study.stability import stability

ROOMS: Mapping[str, ModuleType] = {
    "": pendulum_env, "integrators.": integrators, "lab.": lab, "exact.": exact, "effects.": effects,
    "bench.": bench, "compare.": compare, "controllers.": controllers, "tasks.": tasks, "testing.": testing,
}
"""What is public is in their ``__all__``; what labels begin with."""
BESIDE: tuple[Callable[..., Any], ...] = (
    *BODIES.values(), Medium, *MEDIA.values(), find_scene, build_scene, with_damping, parse_damping, parse_settings,
    choose, stability, stress, demo,
)
"""Documented functions of rooms without such a list."""
UNSPOILT: Mapping[str, str] = {
    **dict.fromkeys(("Rollout", "Sweep", "lab.Circle", "lab.Measurement", "lab.TurningPoints",
                     "lab.Cycles", "lab.Fit", "lab.LabSheet", "lab.Losses", "lab.GateSheet",
                     "lab.AmplitudeSheet", "lab.LengthSheet", "lab.KaterSheet",
                     "lab.Posterior",
                     "lab.DrivenFit", "lab.DrivenPrediction", "lab.FilmTrack",
                     "compare.Comparison", "compare.Drift",
                     "compare.Truth", "integrators.Solution", "integrators.FirstOrderSolution", "testing.VectorCheck",
                     "testing.VectorReport"), "a result, which the package makes"),
    **dict.fromkeys((f"integrators.{name}" for name in (
        "DiscreteGradient", "Embedded", "EmbeddedNystrom", "Exact", "Extension", "ForceGradient", "Method", "Multistep",
        "Nystrom", "RungeKutta", "Splitting", "Taylor")), "a table checks itself, in tests of its own"),
    "integrators.Event": "solve and rollout check it; names of events are allowed in rollout only",
    "effects.Effect": "the base of all effects, which are here", "Study": "the base of all studies",
    "Sweep.to_dict": "takes further keys of any name", "Sweep.to_json": "takes further keys of any name",
    "bench.Device": "the base of all devices", "bench.Reading": "what devices make, which the environment checks",
    "bench.Source": "the base of all sources", "bench.Chunk": "what sources make, which an acquisition checks",
    "integrators.unroll": "writes programs for solve and the engine, from what these have checked",
    **dict.fromkeys(("LabPendulumVectorEnv.call", "LabPendulumVectorEnv.call_at"),
                    "hand arguments on to a method of single environments"),
    "compare.amplitude_and_phase": "takes what compare has made",
    "compare.true_motion": "takes what compare has checked",
}
"""Public names whose keywords are not spoilt, and why."""
METHODS_OF = (
    LabPendulumEnv, LabPendulumVectorEnv, Recording, lab.DrivenLog, VirtualSensor, pendulum_env.Scene, Sweep)
"""Classes whose methods are called by users; those of effects are called by scenes."""


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Every public function, by label; of METHODS_OF the methods, too."""
    seen = set()
    listed = [(label + name, getattr(room, name)) for label, room in ROOMS.items() for name in room.__all__]
    listed += [(f"effects.{effect.__name__}", effect) for effect in effects.EFFECTS.values()]
    for label, entry in (*listed, *((beside.__name__, beside) for beside in BESIDE)):
        if not callable(entry) or id(entry) in seen or (inspect.isclass(entry) and issubclass(entry, Exception)):
            continue
        seen.add(id(entry))
        if label not in UNSPOILT:
            yield label, entry
        for name, method in _own(entry).items() if entry in METHODS_OF else ():
            called = inspect.isfunction(method) or isinstance(method, classmethod)
            if called and not name.startswith("_") and f"{label}.{name}" not in UNSPOILT:
                yield f"{label}.{name}", getattr(entry, name)


def _own(entry: Any) -> dict[str, Any]:
    """What a class of this package has, with what its bases here give it."""
    bases = [base for base in reversed(entry.__mro__) if base.__module__.startswith("pendulum_env")]
    return {name: value for base in bases for name, value in vars(base).items()}


def keywords(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """Its keywords, without ``self`` and ``**parameters``."""
    found = inspect.signature(function).parameters.values()
    return [one for one in found if one.name != "self" and one.kind is not inspect.Parameter.VAR_KEYWORD]


# --- calls that work ------------------------------------------------------------------------------------------------

def still(phi: float) -> float:
    """A reward."""
    return -phi * phi


TIME = np.linspace(0.0, 20.0, 401)
SWING = Recording(TIME, np.cos(3.0 * TIME), "swing")
LOG = lab.DrivenLog(TIME[:100], 0.3 * np.sin(TIME[:100]), np.cos(TIME[:100]))
MOTION = SimpleNamespace(time=TIME, angle=np.cos(3.0 * TIME), velocity=-3.0 * np.sin(3.0 * TIME))


def env() -> LabPendulumEnv:
    made = LabPendulumEnv(backend="python", render_mode="rgb_array", render_size=60)
    made.reset(seed=0)
    return made


def vector() -> LabPendulumVectorEnv:
    made = LabPendulumVectorEnv(2, backend="python", render_mode="rgb_array", render_size=60)
    made.reset(seed=0)
    return made


SELF: Mapping[str, Callable[[], Any]] = {
    "LabPendulumEnv": env, "LabPendulumVectorEnv": vector, "Recording": lambda: SWING, "VirtualSensor": VirtualSensor,
    "lab": lambda: LOG,
    "Scene": lambda: SCENES["lab"],
    "Sweep": lambda: sweep({"angle": [0.1]}, scene="vacuum", duration=0.01, backend="python"),
}
"""What methods are called on."""
SHORT = {"task": "free", "max_episode_steps": 2, "backend": "python", "warn": False}
STARTED = {"angle": 0.1, "velocity": 0.2, "omega0": 3.0, "time": 1.0}
WORKING: Mapping[str, Mapping[str, Any]] = {
    "LabPendulumEnv.set_wrapper_attr": {"name": "mine", "value": 1.0},
    "LabPendulumVectorEnv.set_attr": {"name": "mine", "values": 1.0},
    "LabPendulumVectorEnv.set_state": {"saved": vector().get_state()},
    "Scene.save": {"path": "scene.json"}, "load": {"path": "swing.zip"},
    "audit": {"scene": "vacuum", "amplitude": 0.1, "tolerance": 0.1, "effects": ["gravity"]},
    "simplify": {"scene": "vacuum", "amplitude": 0.1, "tolerance": 0.1, "duration": 1.0},
    "compare": {"scene": "vacuum", "integrators": "rk4", "duration": 0.05},
    "cost": {"scene": "vacuum", "integrators": ["rk4"], "duration": 0.1, "steps": [0.05], "repeats": 1},
    "film": {"scenes": "vacuum", "path": "swing.gif", "duration": 0.05, "size": 50},
    "growth": {"scene": "vacuum", "integrators": ["rk4"], "periods": 1.0},
    "rollout": {"scene": "vacuum", "duration": 0.05},
    "section": {"scene": "chaotic", "runs": 1, "points": 2, "transient": 0, "steps": 20, "backend": "python"},
    "basins": {"scene": "chaotic", "size": 1, "transient": 0, "steps": 20, "backend": "python"},
    "sweep": {"grid": {"angle": [0.1]}, "scene": "vacuum", "duration": 0.01},
    "transfer": {"policy": lambda seen: np.zeros((len(seen), 1)), "nominal": SHORT, "real": SHORT, "episodes": 2},
    "integrators.solve": {"acceleration": lambda t, q, v: -q, "q": 1.0, "v": 0.0, "times": [0.0, 1.0], "h": 0.1},
    "integrators.solve_first_order": {"f": lambda t, y: -y, "y": 1.0, "times": [0.0, 1.0], "h": 0.1},
    "integrators.from_step": {"step": lambda theta, omega, dt, a: (theta + omega * dt, omega + a(theta, omega) * dt)},
    "integrators.System": {"acceleration": lambda t, q, v: -q},
    "integrators.fitting": {"system": integrators.System(lambda t, q, v: -q)},
    "Recording": {"time": TIME, "angle": np.cos(TIME), "source": "swing"},
    "lab.DrivenLog": {"time": TIME, "angle": np.sin(TIME), "drive": np.cos(TIME)},
    "lab.DrivenLog.read": {"path": "driven.csv"}, "lab.DrivenLog.between": {"first": 1.0, "last": 4.0},
    "lab.fit_driven": {"logs": LOG, "mass": 1.0},
    "lab.follow": {"path": "swing.mp4"}, "lab.track": {"path": "swing.mp4"},
    "Recording.read": {"path": "swing.txt"}, "lab.measure_gate": {"path": "gate.txt"},
    "lab.measure_lengths": {"table": ([0.3, 0.6, 0.9], [1.1, 1.56, 1.9])},
    "lab.measure_kater": {"table": ([0.0, 0.1, 0.2], [2.0, 2.01, 2.02], [1.99, 2.01, 2.03]), "edges": 1.0},
    "lab.measure_amplitudes": {"readings": "0:30, 1.42:29.4, 2.84:28.8"},
    "lab.crossings": {"time": TIME, "angle": np.cos(TIME)},
    "lab.noise_level": {"time": TIME, "angle": np.cos(TIME)}, "lab.quantum_level": {"angle": np.cos(TIME)},
    "lab.scatter_level": {"time": TIME, "angle": np.cos(TIME)},
    "lab.fit_circle": {"x": np.cos(TIME), "y": np.sin(TIME)}, "lab.track_angle": {"x": np.cos(TIME), "y": np.sin(TIME)},
    "VirtualSensor.record": {"motion": MOTION}, "VirtualSensor.write": {"path": "recorded.txt", "motion": MOTION},
    "lab.small_amplitude_period": {"period": 1.0, "amplitude": 0.1},
    "lab.corrected_periods": {"series": SWING}, "measure": {"recording": SWING},
    "fit": {"recording": SWING, "effects": "linear", "mass": 0.1},
    "lab.losses": {"points": lab.turning_points(SWING)},
    "lab.decay_rate": {"series": SWING}, "lab.period": {"series": SWING}, "lab.turning_points": {"series": SWING},
    "tasks.find_task": {"task": "free"},
    "Task": {"name": "still", "reward": still},
    "choose": {"scenes": SCENES["vacuum"], "accuracy": 0.1, "dt": 0.02, "steps": 1},
    "compare.write": {"folder": "out", "film": False},
    "LabPendulumVectorEnv": {"num_envs": 2},
    "exact.coulomb_turning_points": {"angle": 0.1, "friction_ratio": 0.01, "n": 3},
    "exact.coulomb_turning_points_linear": {"angle": 0.1, "friction_ratio": 0.01, "n": 3},
    "exact.damped_amplitude": {"time": 1.0, "amplitude": 0.1, "omega0": 3.0},
    "exact.drag_only": {"time": 1.0, "velocity": 1.0, "gamma": 0.1, "c": 0.1},
    "exact.euler_energy_factor": {"omega0": 3.0, "h": 0.01, "method": "forward_euler"},
    "exact.flight": {"length": 1.0, "gravity": 9.81, "angle": 2.0, "velocity": 3.0},
    "exact.linear": STARTED, "exact.pendulum": STARTED,
    "exact.period": {"amplitude": 0.1, "omega0": 3.0},
    "exact.period_rotation": {"velocity": 9.0, "omega0": 3.0},
    "exact.quadratic_turning_point": {"angle": 0.1, "c": 0.1},
    "exact.small_amplitude_series": {"amplitude": 0.1},
    "build_scene": {"scene": "vacuum"},
    "with_damping": {"scene": SCENES["vacuum"], "damping": "none"},
    "demo": {"folder": "out"}, "bench.acquire": {"duration": 0.05},
    "bench.LabPendulumBenchEnv": {"backend": "python"},
    "stress": {"cases": ["upright for a moment"], "integrators": ["rk4"]},
    "testing.check_vector_env": {"make_vec": LabPendulumVectorEnv},
    "controllers.swing_up": {"env": LabPendulumEnv(backend="python")},
    "controllers.load": {"policy": "swing_up"},
    "controllers.evaluate": {
        "policy": controllers.RandomPolicy(),
        "env": LabPendulumVectorEnv(2, max_episode_steps=2, diagnostics=(), backend="python")},
    "controllers.Policy": {"layers": [(np.zeros((3, 1)), np.zeros(1))], "scale": np.ones(3), "card": {}},
}
"""Keywords with which a function is sooner done, or can be called at all."""
BESIDE_IT: Mapping[str, Mapping[str, Any]] = {
    "rtol": {"integrator": "dopri5", "integrators": ["dopri5"], "method": "dopri5"},
    "atol": {"integrator": "dopri5", "integrators": ["dopri5"], "method": "dopri5", "rtol": 1e-3},
    **{key: {"method": "dopri5", "rtol": 1e-3, "h": None} for key in ("first_step", "max_step")},
    "even_steps": {"integrator": "dopri5", "rtol": 1e-3},
    "accuracy": {"integrator": "auto"},
    "file": {"angle": [0.1, 0.2]},
}
"""What goes with a keyword."""
