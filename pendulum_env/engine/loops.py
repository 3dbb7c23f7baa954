"""The loops around a step, as source: dry friction's events, and many steps, recorded or not."""

from __future__ import annotations

from collections.abc import Sequence

from pendulum_env.engine import report, watch
from pendulum_env.engine.adapt import TOLERANCE
from pendulum_env.engine.shape import (
    DIVERGED,
    HOLD,
    LARGEST,
    OK,
    SINE_RANGE,
    SLACK,
    SPEED_LIMIT,
    Shape,
    indent,
    joined,
)


def stick_slip(shape: Shape, timed: bool = False) -> str:
    """One step under dry friction for methods without sub-flows: cut at each zero of the velocity.

    Between zeros the friction's direction is fixed and the problem smooth. At a zero the sum of all other torques
    decides: within the limit the bob stays, beyond it slides on in that direction. Where torques depend on the time
    (``timed``), a bob that would not stay to the step's end breaks away when they reach the limit, found by bisection.
    A step in which the bob turns more than 64 times ends the run as "diverged": its rest would be left out.
    """
    extra, sums = shape.extra, shape.quadratures
    parts = [f"d_{name}" for name in sums]
    step = f"step({joined(('t', 'q', 'v'), shape.lost, ('{}',), extra, ('direction',))})"
    at_rest = f"acceleration(t, q, 0.0, {joined(extra, ('0.0',))})"
    lost = [f"{name}1" for name in shape.lost]
    results = joined(("q1", "v1"), lost, parts)
    return "\n".join(
        [
            "@inline",
            f"def stick_slip({joined(('t', 'q', 'v'), shape.lost, ('h',), extra)}):",
            *indent([f"{name} = 0.0" for name in sums], 1),
            *indent(
                [
                    "left = h",
                    "for _ in range(64):",
                    "    direction = 1.0 if v > 0.0 else -1.0",
                    "    if v == 0.0:",
                    f"        other = {at_rest}",
                    f"        if abs(other) <= {shape.dry}:",
                    *(indent(_breakaway(shape, extra), 3) if timed else ["            break"]),
                    "        direction = 1.0 if other > 0.0 else -1.0",
                    f"    {results} = {step.format('left')}",
                    "    turned = direction*v1 < 0.0",
                    "    part = left",
                    "    if turned:",
                    "        high = left",
                    "        low = 0.5*left",
                    f"        {results} = {step.format('low')}",
                    "        for _ in range(60):",
                    "            if not direction*v1 < 0.0:",
                    "                break",
                    "            high = low",
                    "            low = 0.5*low",
                    f"            {results} = {step.format('low')}",
                    "        for _ in range(100):",
                    "            part = 0.5*(low + high)",
                    "            if part <= low or part >= high:",
                    "                break",
                    f"            {results} = {step.format('part')}",
                    "            if direction*v1 < 0.0:",
                    "                high = part",
                    "            else:",
                    "                low = part",
                    "        part = high",
                    f"        {results} = {step.format('part')}",
                    "        v1 = 0.0",
                    *(["        lost_v1 = 0.0"] if lost else []),
                    "    q = q1",
                    "    v = v1",
                    *[f"    {name} = {name}1" for name in shape.lost],
                    *[f"    {name} = {name} + d_{name}" for name in sums],
                    "    if not turned:",
                    "        break",
                    "    t = t + part",
                    "    left = left - part",
                    "    if left <= 0.0:",
                    "        break",
                    "else:",
                    "    v = 1e999 - 1e999",
                    f"return {joined(('q', 'v'), shape.lost, sums)}",
                ],
                1,
            ),
            "",
        ]
    )


def _breakaway(shape: Shape, extra: Sequence[str]) -> list[str]:
    """At rest at t, for ``left`` more: on to the time from which the other torques are beyond the limit.

    ``break`` where they are not at the end: what they do between is not seen.
    """
    other = f"other = acceleration({joined(('{}', 'q', '0.0'), extra, ('0.0',))})"
    return [
        other.format("t + left"),
        f"if not abs(other) > {shape.dry}:",
        "    break",
        "low = 0.0",
        "high = left",
        "for _ in range(100):",
        "    part = 0.5*(low + high)",
        "    if part <= low or part >= high:",
        "        break",
        f"    {other.format('t + part')}",
        f"    if abs(other) > {shape.dry}:",
        "        high = part",
        "    else:",
        "        low = part",
        "t = t + high",
        "left = left - high",
        "if left <= 0.0:",
        "    break",
        other.format("t"),
    ]


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
    return [*lines, f"reason = {OK}"]


def _begin(shape: Shape) -> list[str]:
    """Lines that begin a method's memory."""
    return [f"{joined(shape.memory)} = begin({joined(('index*h', 'q', 'v', 'h'), shape.extra)})", "held = control"]


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
    """One step with its checks; to stand in a loop that ``break`` leaves."""
    parts = [f"d_{name}" for name in shape.quadratures]
    function = "stick_slip" if shape.slides else "step"
    q_limit = SINE_RANGE if shape.periodic else LARGEST
    finite = f"abs(v1) <= {LARGEST} and abs(q1) <= {q_limit}"
    if parts:
        finite += f" and abs({' + '.join(parts)}) <= {LARGEST}"
    arguments = joined(("index*h", "q", "v"), shape.memory, shape.lost, ("h",), shape.extra)
    call = [f"{joined(('q1', 'v1'), shape.memory, shape.lost, parts)} = {function}({arguments})"]
    if shape.adaptive:
        arguments = joined(("index*h", "q", "v", "h", "size"), TOLERANCE, shape.extra)
        call = [
            f"{joined(('q1', 'v1'), parts, ('size', 'steps', 'vain', 'reason'))} = adapt({arguments})",
            "taken = taken + steps",
            "rejected = rejected + vain",
            f"if reason != {OK}:",
            "    break",
        ]
    lines = [
        *(_remember(shape) if shape.remembered else []),
        *call,
        f"if not ({finite}):",
        f"    reason = {DIVERGED}",
        "    break",
        "q = q1",
        "v = v1",
    ]
    if shape.periodic:
        lines += ["halves = half_turns(q)", turned_back(shape, "q", "lost_q"), "turns = turns + 0.5*halves",
                  "side = side_of(turns)"]
    if shape.compensated:
        lines += [f"{name}, lost_{name} = added({name}, lost_{name}, d_{name}, 0.0)" for name in shape.quadratures]
    else:
        lines += [f"{name} = {name} + d_{name}" for name in shape.quadratures]
    lines.append("index = index + 1.0")
    if shape.slack:
        arguments = joined(("index*h", "q", "v"), shape.extra, shape.pull[:2])
        note = ["slackened = slackened if slackened > 0.0 else index"]
        then = note if shape.lenient else [f"reason = {SLACK}", "break"]
        lines += [f"if tension({arguments}) < 0.0:", *indent(then, 1)]
    return [*lines, "if abs(v) > speed_limit:", f"    reason = {SPEED_LIMIT}", "    break"]


def turned_back(shape: Shape, q: str, lost: str) -> str:
    """The line that takes half turns off an angle."""
    if shape.compensated:
        return f"{q}, {lost} = without_half_turns_kept({q}, {lost}, halves)"
    return f"{q} = without_half_turns({q}, halves)"


def _store(shape: Shape, target: str) -> list[str]:
    potential = f"potential({joined(('q',), shape.place)})"
    values = ["index", "q", "turns", "v", "0.5*v*v", potential, *shape.quadratures, *shape.lost]
    values += watch.values(shape).values()
    return [f"{target.format(i)} = {value}" for i, value in enumerate(values)]


def _report(shape: Shape) -> list[str]:
    """Observation, and the state's last entries."""
    ledger = report.ledger(shape)
    lines = [*report.motion(shape), *(f"{name} = {value}" for name, value in ledger.items())]
    if shape.ledger:
        lines += [f"if {report.ABSURD} and reason <= {SLACK}:", f"    reason = {DIVERGED}"]
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
            *indent(_store(shape, "out[row + 1, {}]"), 3),
            "        if reason != 0:",
            "            break",
            *indent(_store(shape, "state[{}]"), 1),
            *indent(_report(shape), 1),
            "    return reason",
            "",
        ]
    )
