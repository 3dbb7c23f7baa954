"""Tests of ``lab-pendulum show`` with an invisible video driver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from command_line import Here
from fake_clock import Clock

from pendulum_env import LabPendulumEnv
from pendulum_env.window import screen

pygame = pytest.importorskip("pygame")


def key(name: str, down: bool = True) -> Callable[[], None]:
    """Send a key to the only open window."""

    def post() -> None:
        (window,) = screen.OPEN
        code = pygame.key.key_code(name)
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN if down else pygame.KEYUP, key=code, window=window.window))

    return post


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, dict[str, Any]]]:
    """Return the action and the info of each step."""
    found: list[tuple[float, dict[str, Any]]] = []
    own = LabPendulumEnv.step

    def step(env: Any, action: Any) -> Any:
        result = own(env, action)
        found.append((float(action[0]), result[4]))
        return result

    monkeypatch.setattr(LabPendulumEnv, "step", step)
    return found


def test_the_arrow_keys_push(
    clock: Clock, run_here: Here, steps: list[tuple[float, dict[str, Any]]]
) -> None:
    clock.plan = [lambda: None, key("right"), lambda: None, key("right", False), lambda: None, key("tab"), key("q")]
    code, said, wrong = run_here("show", "--angle", "0", "--size", "200", "--dt", "0.02")
    assert (code, said, wrong) == (0, "", "")
    pushes = [push for push, _ in steps]
    assert sorted(set(pushes)) == [0.0, 1.0]
    assert pushes[0] == pushes[-1] == 0.0
    assert steps[0][1]["angle"] == 0.0
    assert steps[-1][1]["angle"] > 0.0
    assert [info["by_hand"] for _, info in steps if "by_hand" in info] == ["integrator"]
    assert screen.OPEN == []


def test_a_run_that_ends_begins_again_in_a_pause(
    clock: Clock, run_here: Here, steps: list[tuple[float, dict[str, Any]]]
) -> None:
    clock.plan = [lambda: None] * 60 + [key("q")]
    code, _, wrong = run_here("show", "--scene", "vacuum", "--damping", "linear:gamma=100", "--integrator",
                              "forward_euler", "--dt", "0.1", "--velocity", "1", "--size", "200")
    assert code == 0
    assert wrong.startswith("The run stopped at ")
    ended = next(i for i, (_, info) in enumerate(steps) if "stop_reason" in info)
    assert [info["time"] for _, info in steps[ended + 1:]] == [0.1]


@pytest.mark.parametrize(("words", "said"), [
    (("--theme", "drak"), "dark"), (("--panels", "apparatus,phse"), "phase"), (("--size", "3"), "render_size"),
    (("--integrator", "rk5"), "rk4"), (("--panels", ""), "panel"),
])
def test_what_cannot_be_is_refused(run_here: Here, words: tuple[str, ...], said: str) -> None:
    code, _, wrong = run_here("show", *words)
    assert code == 2
    assert wrong.startswith("Error: ")
    assert said in wrong
    assert screen.OPEN == []


def test_it_needs_a_display(
    clock: Clock, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen.seen()  # opens the display with SDL_VIDEODRIVER=dummy, which conftest sets
    monkeypatch.setattr(screen, "UNSEEN", ("dummy",))
    monkeypatch.setenv("SDL_VIDEODRIVER", "")
    code, _, wrong = run_here("show")
    assert code == 2
    assert "There is no display" in wrong
