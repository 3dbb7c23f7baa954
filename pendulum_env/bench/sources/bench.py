"""A bench with a motor, driven by a controller, with its simulated twin beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import numpy as np

from pendulum_env.bench.source import TWIN, Chunk, Source, SourceError
from pendulum_env.physics.units import SceneError, choice, flag, setting, si

POLICIES = ("swing_up", "random", "none")
SUBSTEPS = 4
"""Steps of the twin in a control step."""


@dataclass(frozen=True, repr=False, eq=False)
class Bench(Source):
    """The environment ``LabPendulumBench-v0`` under a controller: angles, the actions that follow them, and the twin.

    Opening it brakes the bob and waits until it hangs at rest; the controller acts in runs only, and brings it to rest
    again before the next one. The file of a run is a log that ``pendulum_env.lab.DrivenLog`` reads and
    ``lab-pendulum fit`` fits.
    """

    name: ClassVar[str] = "bench"
    about: ClassVar[str] = "a bench with a motor under a controller, with a simulated twin; virtual, or serial:PORT"
    address: ClassVar[str] = "device"
    place: ClassVar[str] = "DEVICE"
    tested: ClassVar[str] = "the virtual bench, and the sketch in a simulated Uno; no real motor"

    device: Any = setting("virtual", "the bench: virtual, virtual:SCENE, serial:PORT, or a Device")
    scene: Any = setting("lab", "what is known of the bench: a preset's name or a scene's JSON file; in Python a dict "
                         "or Scene")
    policy: str = choice("swing_up", POLICIES, "what drives the motor")
    rate: float = si(50.0, "Hz", "control steps per second", above=0.0)
    confirm: bool = flag(False, "leave for the first motion of a real bench", note="false asks at the terminal")
    _kept: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def columns(self) -> tuple[str, ...]:
        """Titles of angle, action and twin."""
        return "Angle (deg)", "Action", TWIN

    @property
    def notes(self) -> tuple[str, ...]:
        """How many control steps were left out, once it happens."""
        missed = self._kept.get("info", {}).get("missed", 0)
        return (f"missed: {missed} control steps left out, as actions came too late",) if missed else ()

    def open(self) -> None:
        """Bring the bob to rest and find the zero; SourceError for a bench that is not there."""
        from pendulum_env.bench.environment import LabPendulumBenchEnv
        from pendulum_env.controllers import RandomPolicy, SwingUp

        folder = TemporaryDirectory(prefix="lab-pendulum-bench-")
        self._kept.update(folder=folder)
        try:
            env = LabPendulumBenchEnv(
                self.scene, device=self.device, task="free", dt=1.0 / self.rate, substeps=SUBSTEPS, twin=True,
                confirm=True if self.confirm else None, log=Path(folder.name) / "bench.csv", warn=False)
            self._kept.update(env=env)
            policy: Any = (SwingUp(env.scene, 1.0 / self.rate) if self.policy == "swing_up" else
                           RandomPolicy() if self.policy == "random" else lambda seen: np.zeros(1))
            seen, info = env.reset(seed=0)
        except SceneError as error:
            self.close()
            raise SourceError(str(error).rstrip(".")) from None
        self._kept.update(policy=policy, seen=seen, info=info, acts=False, swings=False, before=0.0)

    def begin(self) -> None:
        """Let the controller act, from rest; SourceError for a bob that does not come to rest."""
        kept = self._kept
        if kept["swings"]:
            kept["before"] += kept["info"]["time"] + 1.0 / self.rate
            try:
                kept["seen"], kept["info"] = kept["env"].reset()
            except SceneError as error:
                raise SourceError(str(error).rstrip(".")) from None
        kept.update(acts=True, swings=True)

    def end(self) -> None:
        """Let the controller rest."""
        self._kept["acts"] = False

    def read(self, timeout: float = 0.1) -> Chunk:
        """Make a control step; return the reading before it, and what the motor did then.

        Raises SourceError once a limit, the watchdog or a lost device has stopped the motor.
        """
        kept = self._kept
        before, action = kept["info"], kept["policy"](kept["seen"]) if kept["acts"] else np.zeros(1)
        if before["stop_reason"]:
            raise SourceError(f"the bench has stopped its motor ({before['stop_reason']}); start again")
        kept["seen"], _, _, _, kept["info"] = kept["env"].step(np.asarray(action, dtype=np.float32))
        row = [math.degrees(before["angle"]), float(action[0]), math.degrees(before["twin_angle"])]
        return Chunk(np.array([row]), np.array([kept["before"] + before["time"]]))

    def close(self) -> None:
        """Switch the motor off and close the bench."""
        env, folder = self._kept.pop("env", None), self._kept.pop("folder", None)
        if env is not None:
            env.close()
        if folder is not None:
            folder.cleanup()
