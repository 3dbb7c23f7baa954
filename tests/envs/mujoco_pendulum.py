"""Runs of dm_control's pendulum in MuJoCo, in an environment beside the tests: cases in, rows out, both as JSON."""

from __future__ import annotations

import json
import sys
from typing import Any

MODEL = """
<mujoco><option timestep="{step!r}" integrator="{integrator}" gravity="0 0 -9.81"><flag contact="disable"/></option>
<worldbody><body><joint name="hinge" type="hinge" axis="0 1 0" damping="0.1"/>
<geom type="sphere" pos="0 0 0.5" size="0.05" mass="1"/></body></worldbody>
<actuator><motor joint="hinge" gear="1" ctrlrange="-1 1" ctrllimited="true"/></actuator></mujoco>
"""


def run(case: dict[str, Any]) -> list[list[float]]:
    """Return angle from upright [rad] and velocity [rad/s] after each control."""
    import mujoco

    step = 0.02 / case["substeps"]
    model = mujoco.MjModel.from_xml_string(MODEL.format(step=step, integrator=case["integrator"]))
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = case["angle"], case["velocity"]
    rows = []
    for control in case["controls"]:
        data.ctrl[0] = control
        mujoco.mj_step(model, data, nstep=case["substeps"])
        rows.append([float(data.qpos[0]), float(data.qvel[0])])
    return rows


if __name__ == "__main__":
    json.dump([run(case) for case in json.load(sys.stdin)], sys.stdout)
