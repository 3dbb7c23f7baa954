"""Generated source of one checked integration step: the functions ``advance``, ``stick_slip`` and ``adapt``.

A generated program integrates one scene by one method. Single runs, environments and blocks of environments (see
:mod:`pendulum_env.engine.blocks`) all call its function ``advance``, which :func:`advance` writes.
"""

from __future__ import annotations

from typing import NamedTuple

from integrators import Method
from integrators.solving.step_size import (
    BROKEN,
    GROW,
    SHRINK,
    ratio_powers,
    step_power,
    step_power_of_many,
    step_ratio,
)
from integrators.steps.estimates import embedded_orders, order_of_estimate
from pendulum_env.engine import slack
from pendulum_env.engine.calls import potential, stepped
from pendulum_env.engine.shape import (
    ADAPTED,
    CLIPPED,
    DIVERGED,
    LARGEST,
    OK,
    PAUSED,
    SINE_RANGE,
    SLACK,
    SPEED_LIMIT,
    TOLERANCE,
    TOO_SHORT,
    UNSURE,
    Shape,
    indent,
    joined,
)
from pendulum_env.engine.source import Plain

CALLED: tuple[Plain, ...] = (step_power, step_power_of_many, ratio_powers, step_ratio)
"""Functions that generated adaptive steps call."""


def advanced(shape: Shape, function: str = "advance") -> str:
    """Write the source line that calls the generated ``advance`` and assigns its results.

    It sets ``stop``, the code of the stop reason, and for every name of ``shape.carried`` a variable with "1" appended,
    such as ``q1``, the angle after the step. With ``function="settle"``, and in adaptive runs, it also sets ``portion``
    if slack ends the run: the fraction of the step taken. ``settle`` takes a step in which the wire may go slack.
    """
    results = ("stop", *(f"{name}1" for name in shape.carried), *(ADAPTED if shape.adaptive else ()))
    portion = slack.portion(shape) if shape.adaptive or function == "settle" else ()
    return f"{joined(results, portion)} = {function}({_arguments(shape, 'index*h')})"


def advance(shape: Shape) -> str:
    """Write the source of ``advance``: one step of length ``h`` from the time ``t``.

    The step checks whether the run has to stop: divergence, the speed limit, a slack wire.

    The generated function returns ``stop``, which is 0.0 or the code of the stop reason, and the variables in
    ``shape.carried`` after the step. With the code DIVERGED or TOO_SHORT these are not valid, and the loop that called
    ``advance`` keeps those from before the step. With UNSURE the loop calls ``settle`` in place of ``advance``.
    """
    if shape.adaptive:
        bounded = ("bound - taken - rejected", "params")
        pull = shape.pull[:2] if shape.slack else ()
        arguments = joined(("t", "q", "v", "h", "size"), bounded, TOLERANCE, shape.extra, pull, shape.slackened)
        lines = [f"{joined(interval_results(shape))} = adapt({arguments})", f"return {landed(shape)}"]
    else:
        lines = [f"{joined(shape.step_results)} = {stepped(shape)}", *checked(shape), _returned(shape)]
    title = '"""Return the stop code (0.0 if the run continues) and the state after one step."""'
    return "\n".join(["@inline", f"def advance({_arguments(shape)}):", *indent([title, *lines], 1), ""])


def land(shape: Shape) -> str:
    """Write the source of ``land``: the checks at the end of a step that was divided into adaptive steps.

    Single runs call it in ``advance``, blocks for every pendulum that has come to the end of its step. It takes the
    state before the step and :func:`interval_results`, and returns what ``advance`` returns.
    """
    title = '"""Return the stop code (0.0 if the run continues) and the state after adaptive steps over h."""'
    return "\n".join(["@inline", f"def {landed(shape)}:", *indent([title, *checked(shape), _returned(shape)], 1), ""])


def landed(shape: Shape) -> str:
    """Return the source of the call of ``land``, which is also the head of its definition."""
    fixed = [name for name in shape.extra if name not in shape.carried]
    return f"land({joined(('t', 'h', 'speed_limit'), shape.carried, ADAPTED[1:], interval_results(shape), fixed)})"


def interval_results(shape: Shape) -> tuple[str, ...]:
    """Return the names of the results of adaptive steps over a whole step of h, in the order of ``adapt``."""
    return ("q1", "v1", *(f"d_{name}" for name in shape.quadratures), "size", "steps", "vain", "reason", *_found(shape))


def checked(shape: Shape) -> list[str]:
    """Return the source lines that check the end of a step, and assign ``stop`` and the new state, such as ``q1``."""
    parts = [f"d_{name}" for name in shape.quadratures]
    finite = f"(abs(v1) <= {LARGEST}) & (abs(q1) <= {SINE_RANGE if shape.periodic else LARGEST})"
    if parts:
        finite += f" & (abs({' + '.join(parts)}) <= {LARGEST})"
    lines = [f"good = {finite}"]
    lines += _clipped(shape) if shape.clip else []
    if shape.slack and not shape.adaptive:
        within = joined(("t", "q", "v", "q1", "v1", "h"), slack.watches(shape))
        lines.append(f"sure = {'(slackened > 0.0) | ' if shape.lenient else ''}taut({within})")
    if shape.periodic:
        turned = "q1 = without_half_turns(q1, halves)"
        if shape.compensated:
            turned = "q1, lost_q1 = without_half_turns_kept(q1, lost_q1, halves)"
        lines += ["halves = half_turns(q1)", turned, "turns1 = turns + 0.5*halves", "side1 = side_of(turns1)"]
    for name in shape.sums:
        lost = f"lost_{name}"
        lines.append(f"{name}1, {lost}1 = added({name}, {lost}, d_{name}, 0.0)" if shape.compensated else
                     f"{name}1 = {name} + d_{name}")
    lines.append(f"stop = {SPEED_LIMIT}.0 if abs(v1) > speed_limit else 0.0")
    if shape.lenient:
        loose = "1.0 + (t + loose)/h if (slackened == 0.0) & (loose >= 0.0) else " if shape.adaptive else ""
        lines.append(f"slackened1 = {loose}slackened")
    if shape.slack and not shape.adaptive:
        lines.append(f"stop = stop if sure else {UNSURE}.0")
    lines.append(f"stop = stop if good else {DIVERGED}.0")
    if shape.adaptive:
        lines.append(f"stop = stop if reason == {OK}.0 else reason")
    return lines


def _returned(shape: Shape) -> str:
    """Return the source line that returns the stop code and the state after a step."""
    adapted = ("size", "taken + steps", "rejected + vain") if shape.adaptive else ()
    portion = slack.portion(shape) if shape.adaptive else ()
    return f"return {joined(('stop',), [f'{name}1' for name in shape.carried], adapted, portion)}"


def _clipped(shape: Shape) -> list[str]:
    """Return the source lines that clip the velocity after a step, and sum the energy that this takes.

    A last drift of the step is taken back by the part that the velocity loses.
    """
    bound = shape.clip
    lines = ["free_q = q1", "free_v = v1", f"v1 = max(-{bound}, min({bound}, free_v))"]
    if shape.drift:
        lines.append(f"q1 = free_q - {shape.drift}*h*(free_v - v1)")
    if shape.compensated:
        lines.append("lost_v1 = lost_v1 if v1 == free_v else 0.0")
    if CLIPPED in shape.sums:
        before, after = (potential(shape, q, wrapped=False) for q in ("free_q", "q1"))
        fallen = f" + ({before} - {after})" if shape.drift else ""
        lines.append(f"d_{CLIPPED} = 0.5*(free_v - v1)*(free_v + v1){fallen}")
    return lines


def settle(shape: Shape) -> str:
    """Write the source of ``settle``, which takes a step in which the wire may go slack; see :func:`slack.settle`."""
    return slack.settle(shape, _arguments(shape), shape.carried, f"advance({_arguments(shape)})")


def _found(shape: Shape) -> tuple[str, ...]:
    """Return the name of the result of ``adapt`` for a wire: the fraction of the step taken, or the time of slack."""
    return ("loose",) if shape.lenient else slack.portion(shape)


def _arguments(shape: Shape, t: str = "t") -> str:
    """Return the comma-separated arguments of the generated ``advance`` and ``settle``, for definitions and calls.

    ``t`` is the source of the time at the start of the step.
    """
    state = shape.carried
    fixed = [name for name in shape.extra if name not in state]
    adapted = (*ADAPTED, "bound", "params", *TOLERANCE) if shape.adaptive else ()
    pull = shape.pull[:2] if shape.slack else ()
    return joined((t, "h", "speed_limit"), state, adapted, fixed, pull)


# --- steps of several parts -----------------------------------------------------------------------------------------


def stick_slip(shape: Shape, timed: bool = False, held: bool = False) -> str:
    """Write the source of a step under dry friction, cut at zeros of the velocity, for methods without sub-flows.

    Between zeros the direction of the friction is fixed and the problem is smooth. At a zero the bob sticks if the sum
    of all other torques is within the limit of the friction; otherwise it slides in the direction of this sum. If
    torques depend on the time (``timed``), the time at which a sticking bob breaks away is found by bisection. In
    moving air (``held``) work and heat grow while the bob is at rest. If the velocity changes its sign more than 64
    times in one step, the run ends as "diverged", because the rest of the step was not computed.
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
                    *indent(_breakaway(shape, held) if timed else [*_rest(shape, "left", held), "break"], 3),
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


def _rest(shape: Shape, span: str, held: bool) -> list[str]:
    """Return the source lines that add work and heats of moving air while dry friction holds the bob at rest.

    The rest lasts for the time ``span``.
    """
    if not held:
        return []
    sums = shape.quadratures
    results = "".join(f"d_{name}, " for name in sums)
    return [f"{results}= resting({joined(('t', 'q', span), shape.extra)})",
            *(f"{name} = {name} + d_{name}" for name in sums)]


def _breakaway(shape: Shape, held: bool) -> list[str]:
    """Return the source lines that advance a bob, held at rest by dry friction, from ``t`` until it breaks away.

    ``left`` is the time to the end of the step. If the other torques are within the friction's limit at the end of the
    step, the lines leave the loop by ``break``; a larger torque for a shorter time within the step is overlooked.
    """
    other = f"other = acceleration({joined(('{}', 'q', '0.0'), shape.extra, ('0.0',))})"
    return [
        other.format("t + left"),
        f"if not abs(other) > {shape.dry}:",
        *indent([*_rest(shape, "left", held), "break"], 1),
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
        *_rest(shape, "high", held),
        "t = t + high",
        "left = left - high",
        "if left <= 0.0:",
        "    break",
        other.format("t"),
    ]


def errors_of(method: Method) -> tuple[str, ...]:
    """Return the names of the error estimates that an adaptive step of a method returns."""
    return tuple(f"error_{y}{i}" for i in range(len(embedded_orders(method))) for y in "qv")


EVEN_AIM = 0.8
"""Largest error of a step, in units of the tolerance, at which steps of equal length aim."""
MOST_EVEN = "16777216.0"
"""Largest number of equal steps that an interval is divided into, as source; with more, steps are too short."""


class Attempt(NamedTuple):
    """Source lines of one attempt of an adaptive step from the time ``t + done``, for single runs and for blocks.

    Attributes:
        start: lines that set the progress at the start of a step of h, but for ``a`` and the rates: see ``slope``.
        slope: line that computes the acceleration ``a`` and the rates of the quadratures at the start of a step of h.
        length: lines that set ``now``, the attempt's time, and ``part``, its length.
        short: condition under which the attempt is too short to change the time, and the run ends as TOO_SHORT.
        trial: lines that take the attempt and set ``square``, its squared error in units of the tolerance.
        judged: lines that accept or reject it, and choose the length of the next attempt; where a wire that goes slack
            ends the run, they set ``reason`` to SLACK.
    """

    start: list[str]
    slope: str
    length: list[str]
    short: str
    trial: list[str]
    judged: list[str]


def attempt(shape: Shape, method: Method, power: str) -> Attempt:
    """Return the source lines of one attempt of an adaptive step, chosen as in :mod:`integrators.solving.adaptive`.

    ``power`` is the name of the function of powers: step_power, or step_power_of_many for SIMD code.
    """
    sums = shape.quadratures
    rates = [f"rate_{name}" for name in sums]
    called = f"{'rates' if sums else 'acceleration'}({joined(('t', 'q', 'v'), shape.extra)})"
    pairs = len(embedded_orders(method))
    results = joined(shape.step_results, errors_of(method))
    parts = {y: [f"(error_{y}{i}/scale_{y})" for i in range(pairs)] for y in "qv"}
    squares = [f"square{i} = 0.5*({q}*{q} + {v}*{v})" for i, (q, v) in enumerate(zip(*parts.values(), strict=True))]
    both = "square0*square0/(square0 + 0.01*square1) if square0 > 0.0 else 0.0*square1"
    order = float(order_of_estimate(method))
    cut = "cut" if shape.ends_slack else "part"
    again = f"{results} = {stepped(shape, 'now', 'since')}"
    return Attempt(
        start=[
            *(f"{name} = 0.0" for name in sums),
            *(["loose = -1.0"] if shape.lenient else []),
            "done = 0.0",
            "last = 0.0",
            "most = 10.0",
            "taken = 0.0",
            "rejected = 0.0",
            "size = size if size > 0.0 else h",
        ],
        slope=f"{joined(('a',), rates)} = {called}",
        length=[
            "now = t + done",
            "left = h - done",
            "whole = 1.01*size < left",
            "part = size if whole else left",
        ],
        short="whole & ((now + 0.0625*size == now) | (h + 0.0625*size == h))",
        trial=[
            f"{results} = {stepped(shape, 'now', 'part')}",
            "scale_q = atol + rtol*(abs(q) if abs(q) > abs(q1) else abs(q1))",
            "scale_v = atol + rtol*(abs(v) if abs(v) > abs(v1) else abs(v1))",
            *squares,
            f"square = {'square0' if pairs == 1 else both}",
        ],
        judged=[
            f"accepted = (abs(q1) <= {LARGEST}) & (abs(v1) <= {LARGEST}) & (abs(a1) <= {LARGEST}) & (square <= 1.0)",
            "known = accepted | (square > 1.0) & (square <= 1e300)",
            "inside = square if known & (square > 1e-24) else 1e-24",
            f"error = {power}(inside if inside < 1e40 else 1e40, 0.5)",
            "error = error if known else 1e301",
            f"base, exponent, earlier, share = ratio_powers(error, accepted, last, {order})",
            f"ratio = step_ratio({power}(base, exponent), {power}(earlier, share), error, accepted, last)",
            "tried = part*(most if accepted & (most < ratio) else ratio)",
            "size = size if accepted & (not whole) & (not tried > size) else tried",
            "last = error if accepted & whole else 0.0",
            "most = 10.0 if accepted else 1.0",
            *(slack.adapted(shape, again) if shape.slack else []),
            f"ahead = done + {cut} if {'whole | (cut < part)' if shape.ends_slack else 'whole'} else h",
            "done = ahead if accepted else done",
            *(f"{name} = {name}1 if accepted else {name}" for name in ("q", "v", "a", *rates)),
            *(f"{name} = {name} + d_{name} if accepted else {name}" for name in sums),
            "taken = taken + (1.0 if accepted else 0.0)",
            "rejected = rejected + (0.0 if accepted else 1.0)",
        ],
    )


def adapt(shape: Shape, method: Method) -> str:
    """Write the source of ``adapt``: adaptive steps from t to exactly t + h.

    The first attempt has the length ``size``, or h if that is 0. ``adapt`` returns the state, the quadratures, the next
    step size to try, the numbers of steps taken and rejected, and a stop code; for a wire that ends the run where it
    goes slack also ``portion``, the fraction of h up to there, and for a wire with slack="warn" ``loose``, the time
    from t to there or -1. The errors of angle and velocity are controlled, those of the quadratures are not. After
    ``tries`` attempts it pauses: it stores its progress in ``params`` for the next call, and returns the values from
    before the step.
    """
    lines = attempt(shape, method, step_power.__name__)
    return _adapting(shape, [*lines.start, lines.slope], [
        f"reason = {OK}.0",
        "while done < h:",
        *indent([
            *_paused(),
            *lines.length,
            f"if {lines.short}:",
            f"    reason = {TOO_SHORT}.0",
            "    break",
            *lines.trial,
            *lines.judged,
            *([f"if reason == {SLACK}.0:", "    break"] if shape.ends_slack else []),
        ], 1),
    ])


def adapt_evenly(shape: Shape, method: Method) -> str:
    """Write the source of ``adapt``, see :func:`adapt`, for steps of equal length from t to exactly t + h.

    Their number is that of the interval before, changed so that the largest estimated error of a step is EVEN_AIM times
    the tolerance; it is chosen once for an interval, which costs less than for every step. If an error is larger than
    the tolerance, the interval is taken again with more steps. While it pauses, ``done`` is the number of steps taken,
    ``last`` that of the interval, and ``most`` the largest squared error so far.
    """
    sums, lines = shape.quadratures, attempt(shape, method, step_power.__name__)
    order = float(order_of_estimate(method))
    divided = [
        "share = h/size",
        "last = (share + 6755399441055744.0) - 6755399441055744.0",
        "last = last if last >= share else last + 1.0",
        "part = h/last",
    ]
    short = [f"if (last > {MOST_EVEN}) | (last > 1.0) & ((t + part == t) | (h + 0.0625*part == h)):",
             f"    reason = {TOO_SHORT}.0"]
    rates = [f"rate_{name}" for name in sums]
    return _adapting(shape, [*lines.start, "most = 0.0", lines.slope, *divided], [
        f"reason = {OK}.0",
        "part = h/last",
        *short,
        f"while (reason == {OK}.0) & (done < last):",
        *indent([
            "fine = True",
            "while fine & (done < last):",  # in a loop of its own, in which ``part`` does not change
            *indent([
                *_paused(),
                "now = t + done*part",
                *lines.trial,
                "most = most if square <= most else square",
                *(f"{name} = {name}1" for name in ("q", "v", "a", *rates)),
                *(f"{name} = {name} + d_{name}" for name in sums),
                "done = done + 1.0",
                "taken = taken + 1.0",
                "fine = square <= 1.0",
            ], 1),
            f"if reason == {PAUSED}.0:",
            "    break",
            f"known = (abs(q) <= {LARGEST}) & (abs(v) <= {LARGEST}) & (abs(a) <= {LARGEST}) & (most <= 1e300)",
            "inside = most if known & (most > 1e-24) else 1e-24",
            "inside = inside if inside < 1e40 else 1e40",
            f"ratio = {step_power(EVEN_AIM, 1.0 / order)!r}*{step_power.__name__}(inside, {-0.5 / order!r})",
            f"ratio = ratio if ratio > {SHRINK} else {SHRINK}",
            f"ratio = ratio if ratio < {GROW} else {GROW}",
            f"size = part*(ratio if known else {BROKEN})",
            "if known & fine:",
            "    break",
            "rejected = rejected + done",
            "taken = taken - done",
            "q = start_q",
            "v = start_v",
            *(f"{name} = 0.0" for name in ("done", "most", *sums)),
            lines.slope,
            *divided,
            *short,
        ], 1),
    ])


def _paused() -> list[str]:
    """Return the source lines that leave the loop of an adaptive step after ``tries`` attempts."""
    return ["if taken + rejected >= tries:", f"    reason = {PAUSED}.0", "    break"]


def _adapting(shape: Shape, start: list[str], steps: list[str]) -> str:
    """Write the source of ``adapt``: the lines ``start``, unless the last call paused, the lines ``steps``, the end."""
    sums, under_way = shape.quadratures, shape.params.index("under_way")
    pull, found = shape.pull[:2] if shape.slack else (), _found(shape)
    part = [*enumerate(shape.paused, under_way + 1)]
    body = [
        "first = size",
        *(["start_q = q", "start_v = v"] if shape.even else []),
        f"if params[{under_way}] > 0.0:",
        *(f"    {name} = params[{i}]" for i, name in part),
        f"    params[{under_way}] = 0.0",
        "else:",
        *indent(start, 1),
        *steps,
        f"if reason == {PAUSED}.0:",
        f"    if params[{under_way}] == 0.0:",
        f"        params[{under_way}] = 1.0",
        *(f"        params[{i}] = {name}" for i, name in part),
        "    size = first",
        "    taken = 0.0",
        "    rejected = 0.0",
        *(["portion = done/h"] if shape.ends_slack else []),
        f"return {joined(('q', 'v'), sums, ('size', 'taken', 'rejected', 'reason'), found)}",
    ]
    asked = joined(("t", "q", "v", "h", "size", "tries", "params"), TOLERANCE, shape.extra, pull, shape.slackened)
    head = f"def adapt({asked}):"
    return "\n".join(["@inline", head, *indent(body, 1), ""])
