"""Generated source of the search for the time at which a wire goes slack: ``taut``, ``slack_after`` and ``settle``.

A wire goes slack where its pull falls below zero. ``taut`` looks at every step and costs little: it needs only the
step's ends, and in scenes whose only radial force is the weight no cosine. Where it cannot exclude slack,
``slack_after`` takes parts of the step with the method itself and finds the time of slack to the method's accuracy.
"""

from __future__ import annotations

from collections.abc import Sequence

from pendulum_env.engine.calls import begin, stepped
from pendulum_env.engine.shape import DIVERGED, OK, SLACK, SPEED_LIMIT, Shape, indent, joined

TOUCH = "1e-9"
"""Share of weight and centrifugal force by which the pull on a wire may be below zero within a step, as source.

A bob that is released at the horizontal turns there with a pull of zero, up to rounding and the method's error. At the
ends of steps every pull below zero is slack.
"""
QUARTER = "1.5707963267948966"
"""A quarter of a turn [rad], as source, rounded down: the cosine of every angle within it is positive."""
CLOSE = "1e-15"
"""Least distance of two trials in the search for the time of slack, as a fraction of the step, as source."""


def watches(shape: Shape) -> tuple[str, ...]:
    """Return the names of the arguments after time, angle and velocity in functions that compute the pull."""
    return (*shape.extra, *shape.pull[:2])


def taut(shape: Shape) -> str:
    """Write the source of ``taut``, which returns True if a wire does not go slack in a step, and False if it may.

    It examines the cubic through the angles and velocities at the step's ends. Its angles lie between the smallest and
    the largest of its Bezier control points ``q, q + h v/3, q1 - h v1/3, q1``, its velocities between those of ``v, m,
    v1`` with ``m = 3 (q1 - q)/h - v - v1`` (Farin 2002, Curves and Surfaces for CAGD, 4.2 and 5.3). If weight and
    centrifugal force alone pull on the wire, ``T = M L v² + W g cos(theta)``, it is taut

    - if all control points of the angle are below the horizontal, where the weight pulls outwards, and
    - if ``M L v² > W g`` at all control points of the velocity, which have one sign.

    The control points are beyond the cubic by O(h²), the cubic is beside the motion by O(h⁴). Other scenes need the
    pull at the ends and at the cubic's place of the least pull, that of the parabola through the pulls at both ends
    and in the middle.
    """
    pull = watches(shape)
    ways = ["way = h*v", "way1 = h*v1"]
    if shape.weighed:
        points = ("q", "q1", "q + 0.3333333333333333*way", "q1 - 0.3333333333333333*way1")
        inside = " & ".join(f"(abs({point}) <= {QUARTER})" for point in points)
        fast = " & ".join(f"(swing_pull*{way}*{way} > weight)" for way in ("way", "inner", "way1"))
        lines = [
            *ways,
            "inner = 3.0*(q1 - q) - way - way1",
            "weight = abs(gravity_pull)*h*h",
            f"below = (side > 0.0) & (gravity_pull >= 0.0) & {inside}",
            f"return below | ((way*inner > 0.0) & (inner*way1 > 0.0) & {fast})",
        ]
    else:
        lines = [
            f"before = tension({joined(('t', 'q', 'v'), pull)})",
            f"last = tension({joined(('t + h', 'q1', 'v1'), pull)})",
            *ways,
            "turn = q1 - q",
            "q2 = 0.5*(q + q1) + 0.125*(way - way1)",
            "v2 = (1.5*turn - 0.25*(way + way1))/h",
            f"middle = tension({joined(('t + 0.5*h', 'q2', 'v2'), pull)})",
            *_least("0.5"),
            "place = place if place > 0.0 else 0.0",
            "place = place if place < 1.0 else 1.0",
            "square = 3.0*turn - 2.0*way - way1",
            "cube = way + way1 - 2.0*turn",
            "q2 = q + place*(way + place*(square + place*cube))",
            "v2 = (way + place*(2.0*square + place*3.0*cube))/h",
            f"least = tension({joined(('t + place*h', 'q2', 'v2'), pull)})",
            "return not ((before < 0.0) | (last < 0.0) | (least < 0.0))",
        ]
    return _define("taut", joined(("t", "q", "v", "q1", "v1", "h"), pull),
                   "Return False if the wire may go slack in the step from q, v to q1, v1.", lines)


def _least(otherwise: str) -> list[str]:
    """Return the source lines that set ``place``, where a parabola through three pulls is least, as share of the step.

    The pulls are ``before``, ``middle`` and ``last``; a parabola without a least value has ``otherwise``.
    """
    return ["bend = 4.0*(before + last - 2.0*middle)",
            f"place = (3.0*before + last - 4.0*middle)/bend if bend > 1e-300 else {otherwise}"]


def slack_after(shape: Shape, errors: Sequence[str]) -> str:
    """Write the source of ``slack_after``: the time in a step after which a wire is slack, or inf if it stays taut.

    It is 0 for a wire that is slack at the start. Otherwise the pull is computed after the whole step, after half of
    it, and at the least value of the parabola through these; a pull below zero is then traced back to its zero by the
    Illinois method, the rule of false position in which the value at an end that stays is halved (Dowell & Jarratt
    1971, BIT 11, 168), in some 10 trials. The pulls are those after parts of the step that the method itself takes; a
    multistep method begins anew for each. ``errors`` are the names of the error estimates that a step returns.
    """
    pull, more = watches(shape), _given(shape)
    lines = [
        f"before = tension({joined(('t', 'q', 'v'), pull)})",
        f"touch = {TOUCH}*(swing_pull*v*v + abs(gravity_pull))",
        "if before < -touch:",
        "    return 0.0",
        "before = before if before > 0.0 else 0.0",
        "last = 0.0",
        "least = 0.0",
        "low = 0.0",
        "high = 1e999",
        "stays = 0.0",
        f"close = {CLOSE}*h",
        "part = h",
        "for tries in range(100):",
        *indent([
            f"now = pull_after({joined(('t', 'q', 'v'), more, ('part',), pull)})",
            "if high <= h:",
            *indent([
                "if now < 0.0:",
                "    before = 0.5*before if stays > 0.0 else before",
                "    high = part",
                "    least = now",
                "    stays = 1.0",
                "else:",
                "    least = 0.5*least if stays < 0.0 else least",
                "    low = part",
                "    before = now",
                "    stays = -1.0",
            ], 1),
            "elif now < (0.0 if tries == 0 else -touch):",
            "    high = part",
            "    least = now",
            "elif tries == 0:",
            "    last = now",
            "    part = 0.5*h",
            "    continue",
            "elif tries == 1:",
            *indent([
                "middle = now",
                *_least("0.0"),
                "if not 0.0 < place < 1.0:",
                "    break",
                "part = place*h",
                "continue",
            ], 1),
            "else:",
            "    break",
            "if not high - low > 4.0*close:",
            "    break",
            "part = (low*least - high*before)/(least - before)",
            "part = part if part > low + close else low + close",
            "part = part if part < high - close else high - close",
        ], 1),
        "return high",
    ]
    return "\n".join([
        _pull_after(shape, errors),
        "",
        _define("slack_after", joined(("t", "q", "v"), more, ("h",), pull),
                "Return the time in a step of h after which the wire is slack; inf if it stays taut.", lines),
    ])


def _pull_after(shape: Shape, errors: Sequence[str]) -> str:
    """Write the source of ``pull_after``: the pull on the wire after a step of length ``h``."""
    pull = watches(shape)
    lines = [
        *_begun(shape),
        f"{joined(shape.step_results, errors)} = {stepped(shape)}",
        f"return tension({joined(('t + h', 'q1', 'v1'), pull)})",
    ]
    return _define("pull_after", joined(("t", "q", "v"), _given(shape), ("h",), pull),
                   "Return the pull on the wire after a step of h.", lines)


def settle(shape: Shape, arguments: str, names: tuple[str, ...], call: str) -> str:
    """Write the source of ``settle``: a step in which the wire may go slack, up to the time at which it does.

    The generated function takes the ``arguments`` of ``advance`` and returns its results and, if slack ends the run,
    ``portion``: the fraction of the step that was taken. ``names`` are those of the results after the stop code, and
    ``call`` is the call of ``advance``. A run that continues (slack="warn") takes the whole step.
    """
    others = f"({SPEED_LIMIT}.0 if abs(v1) > speed_limit else {OK}.0)"
    results = f"{joined(('stop',), [f'{name}1' for name in names])} = {call}"
    lines = [f"since = slack_after({joined(('t', 'q', 'v'), _given(shape), ('h',), watches(shape))})",
             "slack = since <= h"]
    if shape.lenient:
        lines += [results, f"stop = stop if stop == {DIVERGED}.0 else {others}",
                  "slackened1 = 1.0 + (t + since)/h if slack else 0.0"]
    else:
        lines += [
            f"stop = {SLACK}.0",
            *(f"{name}1 = {name}" for name in names),
            "portion = since/h if slack else 1.0",
            "if slack:",
            "    h = since",
            *(indent(["if h > 0.0:", *indent(_begun(shape), 1)], 1) if shape.memory else []),
            "if h > 0.0:",
            *indent([results, f"stop = stop if stop == {DIVERGED}.0 else ({SLACK}.0 if slack else {others})"], 1),
        ]
    lines.append(f"return {joined(('stop',), [f'{name}1' for name in names], portion(shape))}")
    return _define("settle", arguments, "Return the stop code and the state after a step that slack may cut short.",
                   lines)


def portion(shape: Shape) -> tuple[str, ...]:
    """Return ("portion",), the name of the fraction of a step that a run takes, if slack may cut a step short."""
    return ("portion",) if shape.ends_slack else ()


def adapted(shape: Shape, step: str) -> list[str]:
    """Return the source lines that look for slack in an accepted adaptive step, and cut the step there.

    ``step`` is the line that takes the step again, with the length ``since``. The lines set ``cut``, the length of the
    step, and ``reason``; with slack="warn" they set ``loose``, the time since the start at which the wire first went
    slack, and leave the step whole.
    """
    pull = watches(shape)
    screen = f"not taut({joined(('now', 'q', 'v', 'q1', 'v1', 'part'), pull)})"
    since = f"since = slack_after({joined(('now', 'q', 'v'), _given(shape), ('part',), pull)})"
    if shape.lenient:
        return [f"if accepted and slackened == 0.0 and loose < 0.0 and {screen}:", f"    {since}",
                "    loose = now - t + since if since <= part else loose"]
    still = [f"d_{name} = 0.0" for name in shape.quadratures]
    return [
        "cut = part",
        f"if accepted and {screen}:",
        f"    {since}",
        "    if since <= part:",
        *indent([
            f"reason = {SLACK}.0",
            "cut = since",
            "q1 = q",
            "v1 = v",
            *still,
            "if since > 0.0:",
            f"    {step}",
        ], 2),
    ]


def _begun(shape: Shape) -> list[str]:
    """Return the source line that computes a multistep method's history for a step of ``h``; none for other methods."""
    return [f"{joined(shape.memory)} = {begin(shape, 't')}"] if shape.memory else []


def _given(shape: Shape) -> tuple[str, ...]:
    """Return the names of what ``slack_after`` takes from the step before: all but a multistep method's history."""
    return tuple(name for name in shape.handed if name not in shape.memory)


def _define(name: str, arguments: str, title: str, lines: list[str]) -> str:
    """Write the source of a function ``name`` with ``arguments`` and the docstring ``title``."""
    return "\n".join(["@inline", f"def {name}({arguments}):", *indent([f'"""{title}"""', *lines], 1), ""])
