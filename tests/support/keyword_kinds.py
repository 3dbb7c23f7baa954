"""The kind of value that each keyword takes, the values that are tried for it, and what a refusal is.

Kinds of the parameters of scenes, effects and sensors, and of settings, follow from their declarations (``si``,
``count``, ``choice``, ``flag``), so that those of a new effect, or a new setting, need no entry.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import Field, fields
from typing import Any

import numpy as np

from pendulum_env import Run, Scene, Sensor, VirtualSensor
from pendulum_env.bench.device import VirtualBoard
from pendulum_env.bench.environment import BenchSettings
from pendulum_env.common.checks import boolean, number, one_of, whole_number
from pendulum_env.envs.settings import VectorSettings
from pendulum_env.physics.bodies import BODIES
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.physics.medium import Medium

VALUES: Mapping[str, Any] = {
    "object": object(), "bytes": b"1", "complex": 1j, "list": [], "list of none": [None], "dict": {}, "set": {5},
    "empty": "", "word": "x", "long": "9" * 10_000, "digits": "1", "nan": math.nan, "inf": math.inf, "-inf": -math.inf,
    "true": True, "none": None, "beyond": 10**5000, "square": np.ones((2, 2)), "text array": np.array("x"),
    "nan array": np.array([1.0, math.nan]), "negative": -1, "zero": 0, "half": 0.5, "huge": 1e308, "tiny": 5e-324,
    "class": int,
}
"""What is tried for every keyword."""

ORDER, EDGE = {"negative", "zero", "half"}, {"huge", "tiny"}
KINDS: Mapping[str, tuple[set[str], set[str]]] = {
    "number": (ORDER, EDGE),
    "positive": ({"half"}, EDGE),
    "least": ({"zero", "half"}, EDGE),
    "one and more": (set(), EDGE),
    "wait": ({"zero", "half", "tiny"}, {"huge"}),
    "count": (set(), {"beyond"}),
    "count or none": ({"zero"}, {"beyond"}),
    "count or endless": ({"negative"}, {"beyond"}),
    "seed": ({"zero"}, {"beyond"}),
    "seeds": ({"zero"}, {"list of none"}),
    "share": (ORDER, {"tiny"}),
    "limit": ({"half", "inf"}, EDGE),
    "part": ({"half"}, {"tiny"}),
    "numbers": (ORDER, {*EDGE, "square", "list"}),
    "states": ({*ORDER, "complex"}, EDGE),
    "tolerance": ({"half", "tiny"}, {"huge"}),
    "positive numbers": ({"half", "zero"}, {*EDGE, "square"}),
    "accuracy": ({"half", *EDGE}, set()),
    "factor": ({"negative", "half"}, EDGE),
    "flag": ({"true"}, set()),
    "word": (set(), set()),
    "word or name": ({"word", "digits", "empty", "long"}, set()),
    "line": ({"word", "digits"}, set()),
    "text": ({"word", "digits", "empty", "long"}, set()),
    "file": ({"word", "digits"}, {"long"}),
    "npy": (set(), set()),
    "mapping": ({"dict"}, set()),
    "list": ({"list"}, set()),
    "names": (set(), set()),
    "function": ({"class"}, set()),
    "progress": ({"class", "true", "none"}, set()),
    "functions": ({"class", "list"}, set()),
    "none of these": (set(), set()),
    "anything": (set(VALUES), set()),
}
"""Kind of keyword -> values that it takes, which are not tried, and values that it may take or refuse.

All others have to be refused; None is not tried where it is the default.
"""


def declared(entry: Field[Any]) -> str:
    """Return the kind of a field made by ``si``, ``count``, ``choice`` or ``flag``."""
    check = entry.metadata["check"]
    if getattr(check, "func", check) is not number:
        return "flag" if check is boolean else "count" if check.func is whole_number else "word"
    limits = check.keywords
    return "positive" if limits["above"] == 0.0 else "least" if limits["least"] == 0.0 else "number"


DECLARED: Mapping[str, str] = {
    entry.name: declared(entry)
    for kind in (
        VectorSettings, BenchSettings, VirtualBoard, *EFFECTS.values(), *BODIES.values(), Medium, Run, Scene, Sensor,
        VirtualSensor)
    for entry in fields(kind)
    if getattr(check := entry.metadata.get("check"), "func", check) in (number, whole_number, one_of, boolean)
}
"""The kind of each parameter that a scene, an effect or a sensor declares, and of each setting of an environment."""

KIND_OF: Mapping[str, str] = DECLARED | {
    name: kind
    for kind, names in {
        "mapping": "sensor scene scenes options values parameters damping",
        "word": "table integrator language method task render_mode theme backend autoreset_mode unit on_error"
                " separator decimal y_axis time_unit states zero form event",
        "positive": "fps slow rtol atol h first_step step evaluations_per_period amplitude pressure omega0"
                    " drive_rate",
        "least": "observation_delay action_delay level tau friction_ratio",
        "count": "every repeats in_flight per_task steps n"
                 " render_size size",
        "count or endless": "max_episode_steps",
        "number": "release at until",
        "one and more": "periods",
        "wait": "hand",
        "part": "above",
        "flag": "robust jumps displaced upright compensated estimate_error complete resume anew"
                " even_steps in_memory as_latex dense velocity_free one_way film recalibrate long raises",
        "none of these": "bob widths randomize reward lost reference points columns pivot motion x y env"
                         " cases integrators executor grid recording action actions body medium saved"
                         " temperature series system times t_eval angles velocities over drop",
        "function": "progress on_point on_line on_row work run acceleration force jacobian dissipative_flow exact_flow"
                    " mean_acceleration mean_jacobian taylor_coefficients make_vec make_single",
        "functions": "events",
        "list": "diagnostics effects settings free args", "names": "notes render_panels panels",
        "limit": "speed_limit velocity_bound max_step",
        "tolerance": "tolerance", "accuracy": "accuracy", "seed": "seed",
        "share": "control",
        "line": "name",
        "file": "file path folder log", "text": "source", "numbers": "q v time", "factor": "scale",
    }.items()
    for name in names.split()
}
"""The kind of each keyword, wherever it occurs."""

OWN: Mapping[str, str] = {
    "Task.start": "mapping", "Task.equation": "text", "Task.ends": "text", "tasks.track.period": "positive",
    "tasks.track.amplitude": "number",
    "rollout.progress": "progress", "stress.progress": "progress", "cost.progress": "progress",
    "sweep.progress": "progress", "fit.progress": "progress", "rollout.file": "npy",
    "compare.progress": "progress", "growth.progress": "progress", "audit.progress": "progress",
    "simplify.progress": "progress", "film.progress": "progress", "section.progress": "progress",
    "basins.progress": "progress", "transfer.progress": "progress", "transfer.policy": "none of these",
    "transfer.nominal": "mapping", "transfer.real": "mapping", "transfer.episodes": "count",
    "Recording.plot.kind": "word", "Sweep.plot.kind": "word", "load.path": "none of these", "load.methods": "list",
    **{f"{name}.save.path": "npy" for name in ("Recording", "Sweep", "lab.DrivenLog")},
    "bench.acquire.source": "none of these", "bench.acquire.duration": "accuracy", "bench.acquire.out": "file",
    "bench.acquire.force": "flag", "bench.acquire.sign": "count or endless", "bench.acquire.zero": "flag",
    "bench.acquire.progress": "progress", "bench.LabPendulumBenchEnv.device": "none of these",
    "bench.LabPendulumBenchEnv.confirm": "progress",
    "rollout.angle": "numbers", "rollout.velocity": "numbers",
    "LabPendulumVectorEnv.render_tiles.count": "count", "LabPendulumVectorEnv.render_tiles.columns": "count",
    "Scene.of_kind.kind": "word", "sweep.name": "text",
    "LabPendulumVectorEnv.get_state.which": "count or none", "LabPendulumVectorEnv.set_state.which": "none of these",
    "LabPendulumVectorEnv.set_attr.values": "anything",
    "LabPendulumVectorEnv.reset.seed": "seeds", "cost.steps": "none of these", "cost.tolerances": "list",
    "Recording.read.part": "none of these", "Recording.read.run": "none of these",
    "Recording.rate": "none of these", "Recording.radius": "none of these",
    "Recording.error": "none of these", "Recording.filmed": "none of these",
    **{f"lab.{name}.{key}": kind for name in ("follow", "track") for key, kind in (
        ("path", "none of these"), ("progress", "progress"), ("rate", "positive"), ("until", "positive"))},
    "Recording.force": "none of these", "Recording.mount": "none of these", "Recording.read.sensor": "number",
    "lab.fit_driven.progress": "progress", "lab.fit_driven.logs": "none of these", "lab.fit_driven.hold": "mapping",
    "lab.fit_driven.moment": "positive", "lab.DrivenLog.time": "none of these", "lab.DrivenLog.angle": "none of these",
    "lab.DrivenLog.drive": "none of these", "lab.DrivenLog.kind": "word", "lab.DrivenLog.notes": "names",
    "lab.DrivenLog.read.factor": "factor", "lab.DrivenLog.read.until": "number",
    **{f"lab.DrivenLog.read.{name}": "none of these" for name in ("path", "action", "torque", "current", "part")},
    "lab.DrivenLog.read.time": "word or name", "lab.DrivenLog.read.angle": "word or name",
    "lab.DrivenLog.between.first": "number", "lab.DrivenLog.between.last": "number",
    "lab.measure_gate.path": "none of these", "lab.measure_gate.length_error": "least",
    "lab.measure_amplitudes.readings": "none of these", "lab.measure_amplitudes.error": "positive",
    "lab.measure_amplitudes.period": "positive", "lab.measure_lengths.table": "none of these",
    "lab.measure_lengths.oscillations": "count", "lab.measure_lengths.amplitude": "least",
    **{f"lab.measure_lengths.{name}_error": "positive" for name in ("length", "period")},
    "lab.measure_kater.table": "none of these", "lab.measure_kater.oscillations": "count",
    "lab.measure_kater.amplitude": "least",
    **{f"lab.measure_kater.{name}": "positive" for name in ("edges", "edges_error", "period_error")},
    "measure.length_error": "least",
    "Scene.load.path": "none of these", "Recording.read.path": "none of these", "stress.scene": "none of these",
    "with_damping.scene": "none of these", "choose.scenes": "list", "Sweep.column.name": "none of these",
    "Scene.save.provenance": "mapping", "Recording.time": "none of these", "Recording.angle": "none of these",
    "exact.euler_energy_factor.h": "number", "air.temperature": "number",
    "water.temperature": "number", "glycerol.temperature": "number",
    "exact.coulomb_turning_points.n": "count or none", "exact.coulomb_turning_points_linear.n": "count or none",
    "exact.linear.omega0": "least", "exact.damped_amplitude.amplitude": "least", "exact.period.amplitude": "numbers",
    "exact.small_amplitude_series.amplitude": "numbers", "exact.period_rotation.velocity": "numbers",
    "exact.euler_energy_factor.omega0": "least", "exact.euler_energy_factor.steps": "count or none",
    "compare.write.comparison": "none of these", "exact.drag_only.time": "numbers",
    "parse_damping.text": "word or name", "effects.PeriodicTorque.drive_rate": "least",
    "lab.crossings.time": "none of these", "lab.crossings.angle": "none of these", "Recording.notes": "names",
    "lab.noise_level.time": "none of these", "lab.noise_level.angle": "none of these",
    "lab.scatter_level.time": "none of these", "lab.scatter_level.angle": "none of these",
    "lab.quantum_level.angle": "list", "Recording.zero": "number", "Recording.read.zero": "number",
    "Recording.centred.zero": "number",
    "lab.small_amplitude_period.period": "positive", "lab.small_amplitude_period.amplitude": "positive numbers",
    "film.path": "npy",
    "choose.progress": "function", "integrators.solve.q": "states", "integrators.solve.v": "states",
    "integrators.solve_first_order.y": "numbers", "integrators.solve_first_order.f": "function",
    "integrators.from_step.step": "none of these", "integrators.from_step.order": "count",
    "integrators.get.name": "none of these", "controllers.SwingUp.scene": "none of these",
    "testing.check_vector_env.steps": "count", "LabPendulumEnv.set_wrapper_attr.value": "anything",
    "LabPendulumEnv.set_wrapper_attr.force": "flag",
    "section.points": "count", "section.runs": "count", "section.transient": "count or none", "section.phase": "number",
    "basins.transient": "count or none",
    "Medium.name": "line", "Scene.has.name": "text",
    "controllers.load.policy": "none of these", "controllers.evaluate.policy": "function",
    "controllers.Policy.layers": "none of these", "controllers.Policy.scale": "none of these",
    "controllers.Policy.card": "mapping",
}
"""The same for keywords that take something else in one function."""
LONGEST = 3000
"""Most characters of a message; those about methods name all there are."""


def outcome(call: Callable[[], object]) -> Exception | None:
    """The error that a call ends with, if it does."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            call()
        except Exception as error:
            return error
    return None


def check_refusal(error: Exception | None, *words: str, what: str = "it") -> None:
    """AssertionError unless it is an error of the package's own, of one line with these words."""
    assert error is not None, f"{what} was taken"
    said = str(error)
    assert type(error).__module__.split(".")[0] in ("pendulum_env", "integrators"), f"{what}: {error!r}"
    assert "\n" not in said
    assert 10 < len(said) < LONGEST
    assert all(word in said for word in words), said
