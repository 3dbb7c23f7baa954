"""One step of the run, taken in as many of an embedded pair's steps as a tolerance asks for: source."""

from __future__ import annotations

from integrators import Method
from integrators.solving.step_size import growth, shrinkage, step_power
from integrators.steps.estimates import embedded_orders, order_of_estimate
from pendulum_env.engine.shape import LARGEST, OK, TOO_SHORT, Shape, indent, joined
from pendulum_env.engine.source import Plain

TOLERANCE = ("rtol", "atol")
"""What such a program takes beside the rest."""

CALLED: tuple[Plain, ...] = (step_power, growth, shrinkage)


def adapt(shape: Shape, method: Method) -> str:
    """From t to t + h exactly, the first try as long as ``size``, or h if that is 0; as
    :mod:`integrators.solving.adaptive`.

    Returns the state, the quadratures, the step to try next, how many were taken and rejected, and why it stopped. The
    angle's and the velocity's errors count, not the quadratures': these ride along.
    """
    sums = shape.quadratures
    rates = [f"rate_{name}" for name in sums]
    slope = f"{'rates' if sums else 'acceleration'}({joined(('t', 'q', 'v'), shape.extra)})"
    pairs = len(embedded_orders(method))
    errors = [f"error_{y}{i}" for i in range(pairs) for y in "qv"]
    results = joined(("q1", "v1", "a1"), [f"{rate}1" for rate in rates], [f"d_{name}" for name in sums], errors)
    parts = {y: [f"(error_{y}{i}/scale_{y})" for i in range(pairs)] for y in "qv"}
    squares = [f"square{i} = 0.5*({q}*{q} + {v}*{v})" for i, (q, v) in enumerate(zip(*parts.values(), strict=True))]
    both = "square0*square0/(square0 + 0.01*square1) if square0 > 0.0 else 0.0*square1"
    order = float(order_of_estimate(method))
    body = [
        *(f"{name} = 0.0" for name in sums),
        f"{joined(('a',), rates)} = {slope}",
        "done = 0.0",
        "last = 0.0",
        "most = 10.0",
        "taken = 0.0",
        "rejected = 0.0",
        f"reason = {OK}",
        "if not size > 0.0:",
        "    size = h",
        "while done < h:",
        *indent(
            [
                "now = t + done",
                "left = h - done",
                "whole = 1.01*size < left",
                "part = size if whole else left",
                "if whole and (now + 0.0625*size == now or h + 0.0625*size == h):",
                f"    reason = {TOO_SHORT}",
                "    break",
                f"{results} = step({joined(('now', 'q', 'v', 'a'), rates, ('part',), shape.extra)})",
                "scale_q = atol + rtol*(abs(q) if abs(q) > abs(q1) else abs(q1))",
                "scale_v = atol + rtol*(abs(v) if abs(v) > abs(v1) else abs(v1))",
                *squares,
                f"square = {'square0' if pairs == 1 else both}",
                f"if abs(q1) <= {LARGEST} and abs(v1) <= {LARGEST} and abs(a1) <= {LARGEST} and square <= 1.0:",
                *indent(
                    [
                        "error = step_power(square if square > 1e-24 else 1e-24, 0.5)",
                        f"ratio = growth(error, last, {order})",
                        "grown = part*(ratio if ratio < most else most)",
                        "size = grown if whole or grown > size else size",
                        "last = error if whole else 0.0",
                        "most = 10.0",
                        "done = done + part if whole else h",
                        "q = q1",
                        "v = v1",
                        "a = a1",
                        *(f"{rate} = {rate}1" for rate in rates),
                        *(f"{name} = {name} + d_{name}" for name in sums),
                        "taken = taken + 1.0",
                    ],
                    1,
                ),
                "else:",
                "    error = step_power(square, 0.5) if 1.0 < square <= 1e300 else 1e301",
                f"    size = part*shrinkage(error, {order})",
                "    last = 0.0",
                "    most = 1.0",
                "    rejected = rejected + 1.0",
            ],
            1,
        ),
        f"return {joined(('q', 'v'), sums, ('size', 'taken', 'rejected', 'reason'))}",
    ]
    head = f"def adapt({joined(('t', 'q', 'v', 'h', 'size'), TOLERANCE, shape.extra)}):"
    return "\n".join(["@inline", head, *indent(body, 1), ""])
