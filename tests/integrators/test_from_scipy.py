"""The page for those who come from SciPy: its snippets, and three scripts ported by it, with SciPy's answers beside."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from readme_code import READMES, run
from scipy.integrate import solve_ivp

from integrators import Event, solve, solve_first_order

PAGE = READMES["integrators/README.md"].split("## Coming from SciPy\n")[1].split("\n## ")[0]
SNIPPETS = re.findall(r"<!-- from scipy -->\n```python\n(.*?)```", PAGE, flags=re.S)


def test_there_are_at_least_ten_snippets_and_no_others() -> None:
    assert len(SNIPPETS) >= 10
    assert PAGE.count("```python") == len(SNIPPETS)


@pytest.mark.parametrize("code", SNIPPETS, ids=range(len(SNIPPETS)))
def test_a_snippet_prints_what_it_says(code: str, tmp_path: Path) -> None:
    said = re.findall(r"^ *print\(.*\)  # (.*)$", code, flags=re.M)
    assert said
    assert run(code, tmp_path)[1] == said


def test_every_word_of_scipys_result_and_signature_is_in_the_table() -> None:
    """Those of ``solve_ivp`` that a user writes or reads."""
    words = ("first_step", "max_step", "rtol", "atol", "jac", "t_eval", "dense_output", "args", "method", "terminal",
             "direction", "sol.t", "sol.y", "sol.sol", "sol.nfev", "sol.status", "sol.success", "sol.message",
             "t_events", "y_events", "RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")
    table = PAGE[: PAGE.index("<!-- from scipy")]
    assert [word for word in words if word not in table] == []


# --- three scripts --------------------------------------------------------------------------------------------------


def test_a_ball_that_bounces_ten_times() -> None:
    """SciPy's script restarts in a loop after every bounce; here the bounce is the action of the event."""
    def floor(t: float, y: Any) -> Any:
        return y[0]

    floor.terminal, floor.direction = True, -1  # type: ignore[attr-defined]
    start, y, times = 0.0, [2.0, 0.0], []
    for _ in range(10):
        peer = solve_ivp(lambda t, y: [y[1], -9.81], (start, 60.0), y, events=floor, method="DOP853", rtol=1e-10,
                         atol=1e-12)
        start, y = peer.t[-1], [0.0, -0.85 * peer.y[1, -1]]
        times.append(start)
    bounce = Event(lambda t, q, v: q, direction=-1, terminal=10, action=lambda t, q, v: (0.0, -0.85 * v))
    second = solve(lambda t, q, v: -9.81, 2.0, 0.0, [0.0, 60.0], method="dop853", rtol=1e-10, atol=1e-12, events=bounce)

    floor.terminal, floor.action = 10, lambda t, y: [0.0, -0.85 * y[1]]  # type: ignore[attr-defined]
    first = solve_first_order(lambda t, y: [y[1], -9.81], [0.0, 60.0], [2.0, 0.0], method="dop853", rtol=1e-10,
                              atol=1e-12, events=floor)
    exact = math.sqrt(2 * 2.0 / 9.81) * (1.0 + 2.0 * np.cumsum([0.0, *(0.85**k for k in range(1, 10))]))
    for ours in (second, first):
        assert ours.t_events[0] == pytest.approx(times, abs=1e-9)
        assert ours.t_events[0] == pytest.approx(exact, abs=1e-11)
        assert ours.t[-1] == ours.t_events[0][-1]


@pytest.mark.slow
def test_van_der_pol_at_5() -> None:
    def slope(t: float, y: Any, mu: float) -> Any:
        return [y[1], mu * (1.0 - y[0] ** 2) * y[1] - y[0]]

    times = np.linspace(0.0, 12.0, 121)
    peer = solve_ivp(slope, (0.0, 12.0), [2.0, 0.0], args=(5.0,), t_eval=times, method="DOP853", rtol=1e-10, atol=1e-10,
                     events=lambda t, y, mu: y[0])
    first = solve_first_order(slope, [0.0, 12.0], [2.0, 0.0], args=(5.0,), t_eval=times, method="dop853", rtol=1e-10,
                              atol=1e-10, events=lambda t, y, mu: y[0])
    second = solve(lambda t, q, v, mu: mu * (1.0 - q**2) * v - q, 2.0, 0.0, [0.0, 12.0], args=(5.0,), t_eval=times,
                   method="dop853", rtol=1e-10, events=lambda t, q, v, mu: q)
    assert first.y == pytest.approx(peer.y, abs=1e-6)
    assert np.array([second.q, second.v]) == pytest.approx(peer.y, abs=1e-6)
    for ours in (first, second):
        assert ours.t_events[0] == pytest.approx(peer.t_events[0], abs=1e-8)
        assert ours.evaluations < 1.2 * peer.nfev  # dense output in every step, where SciPy leaves out some


@pytest.mark.slow
def test_a_driven_pendulum_with_a_pulse_after_100_s() -> None:
    """Damped, driven at rest only by a pulse of 0.1 s; without max_step both programs miss it."""
    def slope(t: float, y: Any) -> Any:
        push = 5.0 if 100.0 <= t < 100.1 else 0.0
        return [y[1], -math.sin(y[0]) - 0.1 * y[1] + push]

    options: dict[str, Any] = {"rtol": 1e-8, "atol": 1e-10}
    times = np.linspace(0.0, 120.0, 1201)
    missed = solve_ivp(slope, (0.0, 120.0), [0.0, 0.0], method="DOP853", **options)
    assert abs(missed.y[0]).max() == 0.0
    peer = solve_ivp(slope, (0.0, 120.0), [0.0, 0.0], method="DOP853", t_eval=times, max_step=0.05, **options)
    first = solve_first_order(slope, [0.0, 120.0], [0.0, 0.0], method="dop853", t_eval=times, max_step=0.05, **options)
    second = solve(lambda t, q, v: slope(t, [q, v])[1], 0.0, 0.0, [0.0, 120.0], method="dop853", t_eval=times,
                   max_step=0.05, **options)
    ends = solve_first_order(slope, [0.0, 100.0, 100.1, 120.0], [0.0, 0.0], method="dop853", t_eval=times, **options)
    assert abs(peer.y[0]).max() > 0.3
    for y in (first.y, np.array([second.q, second.v]), ends.y):
        assert y == pytest.approx(peer.y, abs=2e-7)
    assert ends.evaluations < first.evaluations / 5
