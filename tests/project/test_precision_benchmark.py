"""The benchmark beside other packages: its truth, how it chooses settings, and what it says; none of them needed."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "examples" / "benchmarks"


@pytest.fixture(scope="module")
def parts() -> Iterator[Any]:
    """The modules that need no other package."""
    sys.path.insert(0, str(BENCHMARKS))
    from against import choice, figure, own_lines, problem, report, truth

    yield SimpleNamespace(
        choice=choice, figure=figure, own_lines=own_lines, problem=problem, report=report, truth=truth)
    sys.path.remove(str(BENCHMARKS))
    for name in [name for name in sys.modules if name.partition(".")[0] in ("against", "venvs", "machine")]:
        del sys.modules[name]


def test_steps_of_their_own_are_beside_heyokas(parts: Any) -> None:
    """Check the text on mixed amplitudes: 2 and 3 s for 1e-3, 4 and 12 s for 1e-6, nothing for other scenes."""
    lines = ("lab-pendulum dop853, adaptive", "lab-pendulum rk4", "heyoka, batches of 8")
    times = ((2.0, 1.0, 3.0), (4.0, 1.0, 12.0))
    points = [parts.choice.Point(line, 1.0, error, time)
              for error, each in zip((1e-3, 1e-6), times, strict=True) for line, time in zip(lines, each, strict=True)]
    mixed, other = (parts.problem.Problem(scene, 20.0, 2) for scene in (parts.problem.MIXED, "undamped"))
    text = parts.report.own_steps_text({mixed: points, other: points})
    assert text.startswith(f"Steps of their own: {mixed.title}, 1e-3: 1.00 s (dop853), heyoka 1.5x; ")
    assert text.endswith("1e-6: 2.00 s (dop853), heyoka 3x.")
    assert other.title not in text
    assert parts.report.own_steps_text({other: points}) == ""
    starts = np.degrees(parts.problem.Problem(parts.problem.MIXED, 20.0, 1024).starts)
    assert (starts.min(), starts.max()) == pytest.approx((1.0, 179.0))


def law(parts: Any, order: float, floor: float = 0.0, longest: float = math.inf) -> Any:
    """A method of this order: ``count`` steps take ``count`` seconds and err by ``count**-order`` or the floor."""

    def measure(count: float) -> Any:
        return None if count > longest else parts.choice.Point("a", count, max(floor, count**-order), count)

    return measure


# --- the choice of settings -----------------------------------------------------------------------------------------


def test_the_cheapest_setting_of_a_method_whose_law_is_known(parts: Any) -> None:
    """Order 4: an error of 1e-k takes 10**(k/4) steps at least; what is found takes little more, and is accurate."""
    measure, accuracies = law(parts, 4.0), [10.0**-k for k in range(1, 9)]
    points = parts.choice.climb(measure, parts.choice.step_counts(1.0, 1.0), accuracies[-1])
    assert points[-1].error <= accuracies[-1] < points[-2].error
    points = parts.choice.refine(points, measure, accuracies, True)
    for accuracy in accuracies:
        best = parts.choice.cheapest(points, accuracy)
        needed = accuracy**-0.25
        assert needed * (1 - 1e-12) <= best.setting <= math.ceil(needed * parts.choice.AIM**-0.25) + 1


def test_a_tolerance_between_two_rungs(parts: Any) -> None:
    """Errors 20 times the tolerance: 1e-6 is kept by the rung 1e-8, and cheaper by 0.8e-6/20."""
    points = [parts.choice.Point("a", tol, 20 * tol, -math.log10(tol)) for tol in parts.choice.tolerances(3e-9)]
    assert [point.setting for point in points][-3:] == [1e-7, 1e-8, 3e-9]
    assert parts.choice.cheapest(points, 1e-6).setting == 1e-8
    assert parts.choice.between(points, 1e-6, False) == pytest.approx(4e-8, rel=0.02)
    assert parts.choice.between(points, 1e-9, False) is None
    assert parts.choice.between(points, 10.0, False) is None


def test_a_ladder_ends_at_the_limit_and_at_the_floor(parts: Any) -> None:
    rungs = parts.choice.step_counts(1.0, 1.0)
    limited = parts.choice.climb(law(parts, 2.0, longest=50.0), rungs, 1e-12)
    assert max(point.setting for point in limited) <= 50.0 < rungs[len(limited)]
    floored = parts.choice.climb(law(parts, 2.0, floor=1e-4), rungs, 1e-12)
    assert len([point for point in floored if point.error == 1e-4]) == 1 + parts.choice.STALLED
    lost = parts.choice.climb(lambda count: parts.choice.Point("a", count, math.inf, count), rungs, 1e-3)
    assert len(lost) == len(rungs)
    assert parts.choice.cheapest(lost, 1e-3) is None


def test_steps_start_at_the_longest_and_grow_evenly(parts: Any) -> None:
    assert parts.choice.step_counts(0.1, 0.34, 0.01) == [1, 2, 3, 4, 6, 8, 11]
    counts = parts.choice.step_counts(5.0, 0.34)
    assert counts[0] == 15
    assert all(1.3 < b / a < 1.5 for a, b in pairwise(counts))


def test_what_is_timed_again(parts: Any) -> None:
    point = parts.choice.Point
    points = [point("a", 1, 1e-3, 1.0), point("a", 2, 1e-6, 9.0), point("b", 1, 1e-7, 2.0)]
    assert parts.choice.chosen(points, [1e-3, 1e-6, 1e-9]) == [points[0], points[2], points[1]]
    assert parts.choice.chosen(points, [1e-3, 1e-6], 1.5) == [points[0], points[2]]
    assert parts.choice.contested(points[:2], points[2:], [1e-3, 1e-6, 1e-9], 1.5) == [1e-3]
    assert parts.choice.contested(points[:2], [], [1e-3, 1e-6, 1e-9], 1.5) == [1e-3, 1e-6]


# --- what is said ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found(parts: Any) -> Any:
    point, problem = parts.choice.Point, parts.problem.Problem("undamped", 1000.0, 1)
    return {problem: [
        point("lab-pendulum taylor12", 50, 1e-6, 2e-3), point("lab-pendulum rk4", 500, 1e-4, 1e-3),
        point("lab-pendulum exact", 1, 1e-12, 1e-9), point("scipy DOP853", 1e-8, 5e-7, 0.5),
        point("scipy RK45", 1e-5, 9e-4, 0.09), point("heyoka", 1e-9, 1e-11, 4e-3),
    ]}  # fmt: skip


def test_the_table_by_hand(parts: Any, found: Any) -> None:
    rows = parts.report.table(found, (1e-3, 1e-6, 1e-7)).splitlines()
    assert rows[2:] == [
        "| undamped, 1000 s, 1 trajectory | 1e-3 | 1.00 ms (rk4) | 4.00 ms, 4x | - | 90.0 ms, 90x (RK45) | - |",
        "|  | 1e-6 | 2.00 ms (taylor12) | 4.00 ms, 2x | - | 500 ms, 250x (DOP853) | - |",
        "|  | 1e-7 | - | 4.00 ms | - | - | - |",
    ]
    assert len(parts.report.table(found).splitlines()) == 2 + 8
    assert parts.report.exact_text(found).endswith("1 trajectory: 1.00 ns, error 1.0e-12.")


def test_goals_are_missed_where_one_accuracy_misses_them(parts: Any, found: Any) -> None:
    ours, alone = parts.report.verdicts(found)
    assert ours == ("scipy: takes at least 90 times as long as lab-pendulum (undamped, 1000 s, 1 trajectory, 1e-3), "
                    "goal 150: MISSED")
    assert re.match(r"heyoka: takes at least 2 times .*goal 2.5: MISSED; not reached by .*: .*1e-7; .*1e-10$", alone)
    many = {parts.problem.Problem(problem.scene, problem.duration, 1024): points for problem, points in found.items()}
    (said,) = parts.report.verdicts(many)
    assert re.match(r"heyoka: takes at least 2 times .*MISSED; not reached by lab-pendulum: .*1e-7; .*1e-10$", said)


def test_times_and_units(parts: Any) -> None:
    texts = [parts.report.duration_text(x) for x in (2.5, 0.9999, 0.0123, 4.26e-6, 999.6e-9, 5e-9)]
    assert texts == ["2.50 s", "1.00 s", "12.3 ms", "4.26 µs", "1.00 µs", "5.00 ns"]


@pytest.mark.slow
def test_the_figure_shows_what_was_found(parts: Any, found: Any, tmp_path: Path) -> None:
    (problem,) = found
    own = parts.report.of(found[problem], "lab-pendulum")
    assert parts.figure.front(own, (1e-3, 1e-6, 1e-7)) == [(1e-3, 1e-3), (2e-3, 1e-6)]
    assert parts.figure.save(found, tmp_path / "a.png", {"Software": "test"}).stat().st_size > 10_000


# --- the truth and our own lines ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("gamma", [0.0, 0.3])
def test_the_truth_against_20_digits(parts: Any, gamma: float) -> None:
    """mpmath's Taylor series, through the bottom."""
    mp = pytest.importorskip("mpmath")
    start, time = 2.5, 0.9
    found = parts.truth.taylor(np.array([start, 0.1]), gamma, np.array([0.0, time]), *parts.truth.SERIES)
    with mp.workdps(20):
        rate, drag = mp.mpf(parts.problem.RATE), mp.mpf(gamma)
        solution = mp.odefun(lambda t, y: [y[1], -rate * mp.sin(y[0]) - drag * y[1]], 0, [mp.mpf(start), 0])
        angle = solution(mp.mpf(time))[0]
        assert angle < 0.0
        assert abs(angle - mp.mpf(float(found[0, 1]))) < 2e-16 * max(1.0, abs(angle))


@pytest.mark.slow
def test_the_truth_is_kept_with_its_doubt(parts: Any, tmp_path: Path) -> None:
    for scene in parts.problem.GAMMA:
        problem = parts.problem.Problem(scene, 1.0, 3)
        file, doubt = parts.truth.truth(problem, tmp_path)
        assert doubt < 5e-15
        kept = np.load(file)
        assert kept.shape == (3, parts.problem.RECORDS + 1)
        assert kept[:, 0] == pytest.approx(problem.starts, rel=1e-15)
        assert parts.truth.truth(problem, tmp_path) == (file, doubt)


def test_lines_for_forces_of_the_place_are_not_for_drag(parts: Any) -> None:
    own, problem = parts.own_lines, parts.problem.Problem
    for name, damped in (("rk4", True), ("dprkn12", False), ("taylor20, adaptive", True), ("exact", False)):
        assert own.fits(f"lab-pendulum {name}", problem("undamped", 1.0, 1))
        assert own.fits(f"lab-pendulum {name}", problem("damped", 1.0, 1)) == damped


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["undamped", "damped"])
def test_our_lines_solve_the_problem(parts: Any, scene: str, tmp_path: Path) -> None:
    """Alone by a Machine, by a tolerance, with steps chosen one by one or evenly, and many by rollout."""
    own = parts.own_lines
    for size, line, setting in ((1, "rk4", 2), (1, "dop853, adaptive", 1e-9), (1, "taylor14, even", 1e-9),
                                (3, "rk4", 2)):
        problem = parts.problem.Problem(scene, 1.0, size)
        truth = np.load(parts.truth.truth(problem, tmp_path)[0])
        angles = own.LINES[f"lab-pendulum {line}"](problem)(setting, 1.0)
        assert parts.problem.largest_error(angles, truth) < 2e-9
    assert parts.problem.largest_error(np.full_like(truth, np.nan), truth) == math.inf
