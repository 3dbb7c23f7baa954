"""Units of angles: the table says what is true, and errors and warnings about a unit lead to it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import Here

from pendulum_env import Recording, rollout
from pendulum_env.lab import RecordingError
from pendulum_env.lab.checked import check_half_turn
from pendulum_env.physics.angles import SEE

LARGE = "time,angle\n" + "".join(f"{k / 50},{9.0 * math.cos(5.0 * k / 50):.4f}\n" for k in range(200))
SMALL = "time,angle\n" + "".join(f"{k / 50},{0.9 * math.cos(5.0 * k / 50):.4f}\n" for k in range(200))
WHOLE = "time,angle\n" + "".join(f"{k / 50},{round(900 + 600 * math.cos(5.0 * k / 50))}\n" for k in range(200))


@pytest.mark.parametrize("ask", [
    lambda: check_half_turn(np.array([0.0, 40.0]), "a fit needs a recording that"),
    lambda: rollout("vacuum", angle=60.0, duration=0.1, dt=0.01, backend="python"),
    lambda: Recording.read(written(WHOLE)),
], ids=["half a turn", "60 rad", "whole numbers"])
@pytest.mark.filterwarnings("error")
def test_what_is_said_of_a_unit_leads_to_the_table(
    ask: Callable[[], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises((RecordingError, UserWarning), match=SEE):
        ask()


def written(text: str) -> Path:
    path = Path("swing.csv")
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.filterwarnings("default")
def test_a_command_that_is_given_radians_leads_to_it(run_here: Here) -> None:
    code, _, said = run_here("cost", "--scene", "vacuum", "--angle", "0.0873", "-i", "rk4", "--duration", "0.5")
    assert code == 0
    assert SEE in said
    assert run_here(*SEE.split()[2:])[1].count("degrees") >= 3


@pytest.mark.parametrize(("text", "size"), [(LARGE, math.radians(9.0)), (SMALL, 0.9)], ids=["above 2 pi", "below"])
def test_a_recording_without_a_unit_is_read_as_the_table_says(text: str, size: float, tmp_path: Path) -> None:
    path = tmp_path / "swing.csv"
    path.write_text(text, encoding="utf-8")
    assert np.abs(Recording.read(path).angle).max() == pytest.approx(size, rel=0.02)
