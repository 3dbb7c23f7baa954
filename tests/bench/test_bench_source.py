"""``lab-pendulum acquire --from bench``: a bench live, its log, and the twin's residual on the page."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from asked_pages import ordered, when
from simulated_board import SimulatedBoard

from pendulum_env.bench import SourceError, acquire
from pendulum_env.bench.page import served
from pendulum_env.bench.source import TWIN
from pendulum_env.bench.sources import source_at
from pendulum_env.bench.sources.bench import Bench
from pendulum_env.lab import DrivenLog


class RealBoard(SimulatedBoard):
    real = True


@pytest.mark.slow
@pytest.mark.parametrize(("policy", "largest"), [("swing_up", math.pi), ("random", 0.02), ("none", 0.0)])
def test_a_run_is_a_driven_log_with_its_twin(policy: str, largest: float, tmp_path: Path) -> None:
    out = tmp_path / "bench.csv"
    board = SimulatedBoard()
    acquire(Bench(device=board, policy=policy), duration=5.0, out=out)
    table = np.loadtxt(out, delimiter=",", skiprows=out.read_text().count("#") + 1)
    assert out.read_text().splitlines()[-len(table) - 1] == f"Time (s),Angle (deg),Action,{TWIN}"
    assert len(table) == 251
    angle, twin = np.radians(table[:, 1]), np.radians(table[:, 3])
    assert np.abs(angle).max() >= 0.98 * largest
    if policy != "none":
        assert DrivenLog.read(out).drive.tolist() == pytest.approx(table[:, 2].tolist())
    early = table[:, 0] < 2.0  # near the top every difference grows
    assert np.abs(angle - twin)[early].max() < 0.05
    assert vars(board)["_line"] is None  # closed


def test_a_zero_of_the_page_is_not_that_of_the_action(tmp_path: Path) -> None:
    out = tmp_path / "bench.csv"
    with served(Bench(device=SimulatedBoard(), policy="none"), out=out) as page:
        session = page.session
        when(lambda: math.isfinite(session.acquisition.status.reading))
        session.acquisition.zero = 10.0
        assert ordered(page, "start") == {}
        when(lambda: session.acquisition.status.samples >= 20)
        assert ordered(page, "stop") == {}
    assert session.file is not None
    row = session.file.read_text().splitlines()[-2].split(",")
    assert [float(value) for value in row[1:]] == pytest.approx([-10.0, 0.0, -10.0], abs=0.2)


def test_the_page_draws_the_twin_beside_the_bench(tmp_path: Path) -> None:
    with served(Bench(device=SimulatedBoard(), policy="random"), out=tmp_path / "bench.csv") as page:
        session = page.session
        assert ordered(page, "start") == {}
        when(lambda: len(session.curves.get("beside", {}).get("t", ())) > 50)
        assert ordered(page, "stop") == {}
        curve = session.curves["beside"]
        assert session.file is not None
        table = np.array([line.split(",") for line in session.file.read_text().splitlines()
                          if line[:1].isdigit()], dtype=float)
        shown = np.interp(curve["t"], table[:, 0], table[:, 3])
        assert curve["y"] == pytest.approx(shown, abs=1e-3)


def test_the_motor_is_idle_before_and_after_a_run_and_each_begins_from_rest(tmp_path: Path) -> None:
    board = SimulatedBoard()
    with served(Bench(device=board, policy="random"), out=tmp_path / "bench.csv") as page:
        status = page.session.acquisition
        when(lambda: math.isfinite(status.status.reading))
        told = len(board.told)
        when(lambda: board.clock > 5.0)
        assert len(board.told) == told  # nothing but the brake of the opening
        for _ in range(2):
            assert ordered(page, "start") == {}
            when(lambda: status.status.samples >= 100)
            assert ordered(page, "stop") == {}
        done = board.clock
        when(lambda: board.clock > done + 1.0)
        assert board.firmware.drive == 0
    for run in (1, 2):
        text = (tmp_path / f"bench-run{run}.csv").read_text()
        table = np.array([line.split(",") for line in text.splitlines() if line[:1].isdigit()], dtype=float)
        assert abs(table[0, 1]) < 1.0
        assert table[0, 2] != 0.0
        assert np.diff(table[:, 0]) == pytest.approx(0.02, abs=1e-6)


def test_a_limit_or_the_watchdog_ends_the_source_with_its_reason(tmp_path: Path) -> None:
    board = SimulatedBoard(torque=5.0)
    with pytest.warns(UserWarning, match=r"The run ended early: the bench has stopped its motor \(speed_limit\)"):
        acquire(Bench(device=board, policy="random"), duration=20.0, out=tmp_path / "bench.csv")
    assert board.drive_at(board.clock + 1.0) == 0


@pytest.mark.parametrize(("source", "said"), [
    (Bench(device=RealBoard()), "The first motion of a bench has to be confirmed"),
    (Bench(device="serial:/dev/ttyNONE", confirm=True), "there is no port /dev/ttyNONE"),
    (Bench(device="virtuel"), "There is no device 'virtuel'; did you mean virtual"),
    (Bench(scene="vacuum"), "needs gravity and a motor to be a bench")])
def test_a_bench_that_is_not_there_is_said(source: Bench, said: str) -> None:
    with pytest.raises(SourceError, match=said):
        acquire(source, duration=1.0)


def test_leave_is_an_option(tmp_path: Path) -> None:
    board = RealBoard()
    acquire(Bench(device=board, confirm=True), duration=0.5, out=tmp_path / "bench.csv")
    assert board.told


def test_the_address_is_that_of_the_device() -> None:
    found = source_at("bench:serial:/dev/ttyACM0", {"rate": 100.0, "policy": "none"})
    assert isinstance(found, Bench)
    assert (found.device, found.rate, found.policy) == ("serial:/dev/ttyACM0", 100.0, "none")
    assert isinstance(source := source_at("bench"), Bench)
    assert source.device == "virtual"
