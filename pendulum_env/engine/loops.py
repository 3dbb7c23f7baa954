"""The loop of a single run, as source: many steps, recorded or not."""

from __future__ import annotations

from pendulum_env.engine import report, watch
from pendulum_env.engine.advance import TOLERANCE, advanced, begin, carried
from pendulum_env.engine.shape import DIVERGED, HOLD, OK, TOO_SHORT, Shape, indent, joined


def _unpack(shape: Shape) -> list[str]:
    more = (*(TOLERANCE if shape.adaptive else ()), *(HOLD if shape.remembered else ()))
    lines = [f"{name} = params[{i}]" for i, name in enumerate((*shape.numbers, *more))]
    names = ["index", "q", "turns", "v", "", "", *shape.quadratures, *shape.lost]
    lines += [f"{name} = state[{i}]" for i, name in enumerate(names) if name]
    if shape.periodic:
        lines.append("side = side_of(turns)")
    kinetic, potential, _ = report.energy_of(shape).values()
    lines += [f"initial = state[{len(shape.recorded)}]", "if index == 0.0:", f"    initial = {kinetic} + {potential}"]
    lines += [f"{name} = state[{i}]" for i, name in enumerate(shape.kept[1:], len(shape.recorded) + 1)]
    if shape.memory and not shape.remembered:
        lines += [f"if {shape.stale} and rows*every > 0:", *indent(_begin(shape), 1)]
    return [*lines, f"stop = {OK}.0"]


def _begin(shape: Shape) -> list[str]:
    """Lines that begin a method's memory."""
    return [f"{joined(shape.memory)} = {begin(shape)}", "held = control"]


def _remember(shape: Shape) -> list[str]:
    """Lines at the start of a step that advance what effects remember, once per control step."""
    lines = [
        "first = 1.0 if index == 0.0 else 0.0",
        shape.remember("hold*h"),
        *(f"{name} = {name}1" for name in shape.remembered),
        *(_begin(shape) if shape.memory else []),
    ]
    return ["if phase == 0.0:", *indent(lines, 1), "phase = phase + 1.0", "phase = phase if phase < hold else 0.0"]


def _one_step(shape: Shape) -> list[str]:
    """One step; to stand in a loop that ``break`` leaves."""
    fails = f"stop == {DIVERGED}.0{f' or stop == {TOO_SHORT}.0' if shape.adaptive else ''}"
    return [
        *(_remember(shape) if shape.remembered else []),
        advanced(shape),
        f"if {fails}:",
        "    break",
        *(f"{name} = {name}1" for name in carried(shape)),
        "index = index + 1.0",
        "if stop != 0.0:",
        "    break",
    ]


def _store(shape: Shape, target: str) -> list[str]:
    potential = f"potential({joined(('q',), shape.place)})"
    values = ["index", "q", "turns", "v", "0.5*v*v", potential, *shape.quadratures, *shape.lost]
    values += watch.values(shape).values()
    return [f"{target.format(i)} = {value}" for i, value in enumerate(values)]


def _judged(shape: Shape) -> list[str]:
    """Lines that end a run at a recorded state that its ledger shows to be nonsense."""
    if not shape.accounts:
        return []
    return [*(f"{name} = {value}" for name, value in report.balance(shape).items()), report.judged("stop")]


def _report(shape: Shape) -> list[str]:
    """Observation, and the state's last entries."""
    ledger = report.ledger(shape)
    lines = [*report.motion(shape), *(f"{name} = {value}" for name, value in ledger.items())]
    if shape.ledger:
        lines.append(report.judged("stop"))
    values = [*shape.kept, "phi", *ledger]
    lines += [f"state[{i}] = {value}" for i, value in enumerate(values, len(shape.recorded))]
    return [*lines, *(f"seen[{i}] = {name}" for i, name in enumerate(report.SEEN))]


def run(shape: Shape) -> str:
    """``rows`` times ``every`` steps in place: the one entry into a program, so that only one is compiled.

    The state keeps its last finite values, and what it says then is put behind them and, as an observation, into the
    three float32 of ``seen``. An ``out`` of ``rows + 1`` rows takes the start, then the state after every ``every``
    steps, then where it stopped; an empty one takes nothing.
    """
    return "\n".join(
        [
            "@entry",
            "def run(state, params, control, h, rows, every, speed_limit, out, seen):",
            *indent(_unpack(shape), 1),
            "    records = len(out) > 0",
            "    if records:",
            *indent(_store(shape, "out[0, {}]"), 2),
            "    for row in range(rows):",
            "        before = index",
            "        for _ in range(every):",
            *indent(_one_step(shape), 3),
            "        if records and index > before:",
            *indent([*_store(shape, "out[row + 1, {}]"), *_judged(shape)], 3),
            "        if stop != 0.0:",
            "            break",
            *indent(_store(shape, "state[{}]"), 1),
            *indent(_report(shape), 1),
            "    return int(stop)",
            "",
        ]
    )
