"""A clock that a test sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from pendulum_env import LabPendulumEnv
from pendulum_env.window import screen

DT = 0.02


class Clock:
    """Time of the test's own: it passes while something sleeps, and then what was planned happens."""

    def __init__(self) -> None:
        self.time, self.sleeps, self.plan = 1000.0, 0, list[Callable[[], object]]()

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0.0
        self.time += seconds
        self.sleeps += 1
        assert self.sleeps < 10_000, "it waits for ever"
        if self.plan:
            self.plan.pop(0)()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[Clock]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    found = Clock()
    monkeypatch.setattr(screen, "now", found.now)
    monkeypatch.setattr(screen, "sleep", found.sleep)
    yield found
    for shown in list(screen.OPEN):
        shown.close()


def shown(**keywords: Any) -> Any:
    """An environment in its window, started."""
    options = {"scene": "lab", "task": "free", "backend": "python", "dt": DT, "render_size": 300, **keywords}
    env: Any = LabPendulumEnv(render_mode="human", **options)
    env.reset(seed=1, options={"angle": 0.5})
    env.window.screen.happened()
    return env
