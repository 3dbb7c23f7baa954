"""Views have the energies of info, for methods and effects that add variables to the state, too."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from pendulum_env import SCENES
from pendulum_env.engine.machine import Machine
from pendulum_env.films import picture


@pytest.mark.parametrize("scene", ["lab", "windy"])
@pytest.mark.parametrize("integrator", ["rk4", "velocity_verlet", "adams_bashforth2"])
def test_frames_show_the_ledger_of_info(scene: str, integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(picture, "drawn", lambda _, view, *_more: shown.append(view) or np.zeros((50, 50, 3)))
    env = gym.make("LabPendulum-v0", scene=scene, integrator=integrator, render_mode="rgb_array", backend="python",
                   substeps=8, disable_env_checker=True)
    env.reset(seed=0, options={"angle": 1.0, "velocity": 0.0})
    for _ in range(5):
        *_, info = env.step(np.array([0.5], dtype=np.float32))
    env.render()
    (view,) = shown
    names = ("kinetic_energy", "potential_energy", "work", "heat", "energy_residual")
    assert (view.kinetic, view.potential, view.work, view.heat, view.residual) == tuple(info[name] for name in names)


@pytest.mark.parametrize(("scene", "torque", "work"), [
    ("lab", True, True), ("driven", False, True), ("vacuum", False, False)])
def test_motor_and_work_are_shown_where_there_are_any(scene: str, torque: bool, work: bool) -> None:
    machine = Machine(SCENES[scene], "rk4", backend="python")
    view = picture.view(machine, machine.state(0.5, 0.0), 0.01, 0.0, 0.5, (), ())
    assert (view.torque_share is not None, view.work is not None) == (torque, work)
