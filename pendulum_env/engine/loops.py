"""Generated source of ``run``, the loop over the steps of a single run."""

from __future__ import annotations

from pendulum_env.engine import report, watch
from pendulum_env.engine.advance import advanced
from pendulum_env.engine.calls import begin
from pendulum_env.engine.shape import BOUND, DIVERGED, OK, PAUSED, TOO_SHORT, UNSURE, Shape, indent, joined


def _unpack(shape: Shape) -> list[str]:
    """Return the first source lines of ``run``: local names for parameters and state, and the initial energy."""
    before = shape.params.index(BOUND[-1]) if shape.adaptive else len(shape.params)
    lines = [f"{name} = params[{i}]" for i, name in enumerate(shape.params[:before])]
    names = ["index", "q", "turns", "v", "", "", *shape.sums, *shape.lost]
    lines += [f"{name} = state[{i}]" for i, name in enumerate(names) if name]
    if shape.periodic:
        lines.append("side = side_of(turns)")
    kinetic, height, _ = report.ENERGIES.values()
    lines += [f"initial = state[{len(shape.recorded)}]", report.stored(shape),
              "if index == 0.0:", f"    initial = {kinetic} + {height}"]
    lines += [f"{name} = state[{i}]" for i, name in enumerate(shape.kept[1:], len(shape.recorded) + 1)]
    if shape.adaptive:
        tried = " + ".join(f"params[{shape.params.index(f'paused_{name}')}]" for name in ("taken", "rejected"))
        lines += ["bound = taken + rejected + tries", f"if params[{before}] > 0.0:", f"    bound = bound + {tried}"]
    if shape.memory and not shape.remembered:
        lines += [f"if {shape.stale} and rows*every > 0:", *indent(_begin(shape), 1)]
    return [*lines, f"stop = {OK}.0"]


def _begin(shape: Shape) -> list[str]:
    """Return the source lines that compute a multistep method's first history."""
    return [f"{joined(shape.memory)} = {begin(shape)}", "held = control"]


def _remember(shape: Shape) -> list[str]:
    """Return the source lines that advance the effects' state variables, such as gusts, once per control step."""
    lines = [
        "first = 1.0 if index == 0.0 else 0.0",
        shape.remember("hold*h"),
        *(f"{name} = {name}1" for name in shape.remembered),
        *(_begin(shape) if shape.memory else []),
    ]
    code = ["if phase == 0.0:", *indent(lines, 1), "phase = phase + 1.0", "phase = phase if phase < hold else 0.0"]
    return [f"if params[{shape.params.index(BOUND[-1])}] <= 0.0:", *indent(code, 1)] if shape.adaptive else code


def _one_step(shape: Shape) -> list[str]:
    """Return the source lines of one step in the body of a loop. They leave the loop by ``break`` if the run stops."""
    codes = (DIVERGED, *((TOO_SHORT, PAUSED) if shape.adaptive else ()))
    fails = " or ".join(f"stop == {code}.0" for code in codes)
    cut = shape.ends_slack
    search = [*(["portion = 1.0"] if cut else []), f"if stop == {UNSURE}.0:", f"    {advanced(shape, 'settle')}"]
    return [
        *(_remember(shape) if shape.remembered else []),
        advanced(shape),
        *(search if shape.slack and not shape.adaptive else []),
        f"if {fails}:",
        "    break",
        *(f"{name} = {name}1" for name in shape.carried),
        f"index = index + {'portion' if cut else '1.0'}",
        "if stop != 0.0:",
        "    break",
    ]


def _store(shape: Shape, target: str) -> list[str]:
    """Return the source lines that write the recorded values, after :func:`report.stored`.

    ``target`` is the source of the array entry, with {} for the index.
    """
    values = ["index", "q", "turns", "v", "0.5*v*v", "r_stored", *shape.sums, *shape.lost]
    values += watch.values(shape).values()
    return [f"{target.format(i)} = {value}" for i, value in enumerate(values)]


def _judged(shape: Shape) -> list[str]:
    """Return the source lines that end a run if the energy residual of a recorded state is absurdly large."""
    if not shape.accounts:
        return []
    return [*(f"{name} = {value}" for name, value in report.balance(shape).items()), report.judged("stop")]


def _report(shape: Shape) -> list[str]:
    """Return the source lines that compute the observation and the reported entries (``info``) of the state."""
    ledger = report.ledger(shape)
    lines = [*report.motion(shape), *(f"{name} = {value}" for name, value in ledger.items())]
    if shape.ledger:
        lines.append(report.judged("stop"))
    lines += [f"state[{i}] = {value}" for i, value in enumerate(("phi", *ledger), shape.phi)]
    return [*lines, *(f"seen[{i}] = {name}" for i, name in enumerate(report.SEEN))]


def run(shape: Shape) -> str:
    """Write the source of ``run``, the function of a program that Python calls to take ``rows`` times ``every`` steps.

    It advances the state in place; the state keeps its last finite values. The reported quantities are written to its
    last entries and the observation to ``seen``, three float32; with an empty ``seen`` neither is computed. ``out``, an
    array of ``rows + 1`` rows, receives the initial state, the state after every ``every`` steps, and the state at a
    stop; with an empty ``out`` nothing is recorded. :mod:`pendulum_env.engine.pieces` divides long runs into several
    calls of ``run``.
    """
    stored = f"records and index > before{f' and stop != {PAUSED}.0' if shape.adaptive else ''}"
    return "\n".join(
        [
            "@entry",
            "def run(state, params, control, h, rows, every, speed_limit, out, seen):",
            *indent(_unpack(shape), 1),
            "    records = len(out) > 0",
            "    if records:",
            *indent(_store(shape, "out[0, {}]"), 2),
            *(["    if records and rows == 0:", *indent(_judged(shape), 2)] if shape.accounts else []),
            "    for row in range(rows):",
            "        before = index",
            "        for _ in range(every):",
            *indent(_one_step(shape), 3),
            f"        if {stored}:",
            *indent([report.stored(shape), *_store(shape, "out[row + 1, {}]"), *_judged(shape)], 3),
            "        if stop != 0.0:",
            "            break",
            *indent([report.stored(shape), *_store(shape, "state[{}]")], 1),
            *(f"    state[{i}] = {name}" for i, name in enumerate(shape.kept, len(shape.recorded))),
            "    if len(seen) > 0:",
            *indent(_report(shape), 2),
            "    return int(stop)",
            "",
        ]
    )
