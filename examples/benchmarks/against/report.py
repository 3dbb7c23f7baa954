"""Text reports of the precision benchmark: tables per problem and accuracy, and whether the goals are met."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from against.choice import Point, cheapest
from against.problem import MIXED, Problem

OWN, EXACT, ADAPTIVE, EVEN = "lab-pendulum", "lab-pendulum exact", ", adaptive", ", even"
PEERS = ("heyoka", "diffrax", "scipy", "MuJoCo")
Found = Mapping[Problem, Sequence[Point]]


class Goal(NamedTuple):
    """Goal: this package is ``factor`` times as fast as a peer, for these durations [s] and numbers of trajectories."""

    peer: str
    factor: float
    durations: tuple[float, ...] = ()
    sizes: tuple[int, ...] = ()

    def covers(self, problem: Problem) -> bool:
        """Return True if the goal applies to a problem."""
        return (not self.durations or problem.duration in self.durations) and (
            not self.sizes or problem.size in self.sizes)


GOALS = (Goal("scipy", 150.0, (1000.0,), (1,)), Goal("diffrax", 1.0), Goal("MuJoCo", 1.0),
         Goal("heyoka", 2.5, (), (1,)), Goal("heyoka", 1.0, (), (1024,)))


def of(points: Sequence[Point], package: str) -> list[Point]:
    """Return the points of a package, without the closed form."""
    return [point for point in points if point.line.startswith(package) and point.line != EXACT]


def ratio(points: Sequence[Point], peer: str, accuracy: float) -> float | None:
    """Return the ratio of a peer's best time to this package's; None if one of them does not reach the accuracy."""
    ours, theirs = (cheapest(of(points, package), accuracy) for package in (OWN, peer))
    return None if ours is None or theirs is None else theirs.time / ours.time


def duration_text(seconds: float) -> str:
    """Format a time with three digits and a unit."""
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:#.3g}".rstrip(".") + f" {unit}"
    return f"{seconds * 1e9:#.3g}".rstrip(".") + " ns"


def power_text(accuracy: float) -> str:
    """Format an accuracy as 1e-3, not 1e-03."""
    return f"{accuracy:.0e}".replace("e-0", "e-")


def cell(points: Sequence[Point], problem: Problem, package: str, accuracy: float) -> str:
    """Return a table cell: a package's best time per trajectory, its ratio to this package's time, and the solver."""
    best = cheapest(of(points, package), accuracy)
    if best is None:
        return "-"
    times = "" if package == OWN or (found := ratio(points, package, accuracy)) is None else f", {found:.3g}x"
    line = best.line.removeprefix(package).strip(" ,")
    return f"{duration_text(best.time / problem.size)}{times}{f' ({line})' if line else ''}"


def table(found: Found, accuracies: Sequence[float] = ()) -> str:
    """Return a Markdown table with a row for each problem and accuracy; ``accuracies`` selects some accuracies."""
    lines = [f"| time per trajectory | angle error below [rad] | {OWN} | {' | '.join(PEERS)} |",
             "|" + "---|" * (3 + len(PEERS))]
    for problem, points in found.items():
        title = problem.title
        for accuracy in problem.accuracies:
            if accuracies and accuracy not in accuracies:
                continue
            cells = [cell(points, problem, package, accuracy) for package in (OWN, *PEERS)]
            lines.append(f"| {title} | {power_text(accuracy)} | {' | '.join(cells)} |")
            title = ""
    return "\n".join(lines) + "\n"


def limit_text(limit: float) -> str:
    """Return the explanation of "-" in the table."""
    return f"-: not reached by any run of at most {limit:g} s, of one trajectory or of all."


def exact_text(found: Found) -> str:
    """Return a text with error and time of the closed form in each problem that has one."""
    each = [(problem, point) for problem, points in found.items() for point in points if point.line == EXACT]
    entries = [f"{problem.title}: {duration_text(point.time / problem.size)}, error {point.error:.1e}"
            for problem, point in each]
    return f"The closed form, which does not compete: {'; '.join(entries)}." if entries else ""


def own_steps_text(found: Found) -> str:
    """Return a text with the best times of this package where each pendulum takes steps of its own, beside heyoka's.

    Only problems with mixed amplitudes count; in others all trajectories need about the same steps.
    """
    entries = []
    for problem, points in found.items():
        own = [point for point in points if point.line.endswith(ADAPTIVE)] if problem.scene == MIXED else []
        for accuracy in problem.accuracies:
            best, theirs = cheapest(own, accuracy), cheapest(of(points, PEERS[0]), accuracy)
            if best and theirs:
                name = best.line.removeprefix(OWN).removesuffix(ADAPTIVE).strip()
                entries.append(f"{problem.title}, {power_text(accuracy)}: {duration_text(best.time / problem.size)} "
                               f"({name}), {PEERS[0]} {theirs.time / best.time:.3g}x")
    return f"Steps of their own: {'; '.join(entries)}." if entries else ""


def verdicts(found: Found) -> list[str]:
    """Return a line for each goal with the worst ratio, its problem, and accuracies that only the peer reaches."""
    lines = []
    for goal in GOALS:
        ratios, absent = [], []
        for problem, points in found.items():
            for accuracy in problem.accuracies if goal.covers(problem) else ():
                times = ratio(points, goal.peer, accuracy)
                where = f"{problem.title}, {power_text(accuracy)}"
                if times is not None:
                    ratios.append((times, where))
                elif cheapest(of(points, OWN), accuracy) is None and cheapest(of(points, goal.peer), accuracy):
                    absent.append(where)
        if not ratios and not absent:
            continue
        worst = min(ratios, default=(float("inf"), "nowhere"))
        met = worst[0] >= goal.factor and not absent
        missing = f"; not reached by lab-pendulum: {'; '.join(absent)}" if absent else ""
        lines.append(f"{goal.peer}: takes at least {worst[0]:.3g} times as long as lab-pendulum ({worst[1]}), "
                     f"goal {goal.factor:g}: {'met' if met else 'MISSED'}{missing}")
    return lines
