"""Record a rollout in real time with Gymnasium's RecordVideo wrapper: `python 04_record_a_video.py FOLDER`"""

import sys
import tempfile
from pathlib import Path

import gymnasium as gym
import numpy as np

import pendulum_env  # noqa: F401

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
env = gym.make("LabPendulum-v0", render_mode="rgb_array", render_size=300, dt=0.04)
env = gym.wrappers.RecordVideo(env, str(folder / "films"), disable_logger=True)
observation, info = env.reset(seed=0)
for _ in range(75):  # push with the swing: the motor is too weak to lift the bob directly
    observation, *_ = env.step(np.sign(observation[2:]))
env.close()

(film,) = (folder / "films").glob("*.mp4")
print(f"wrote {film}, {film.stat().st_size / 1000:.0f} kB, {75 * 0.04:.1f} s at true speed")
assert film.stat().st_size > 1000
