"""Source lines that compute the Taylor coefficients of a motion from the recorded operations of its acceleration.

With ``x = sum_k x_k h**k``, each operation's coefficient of order k follows from those of its operands up to k
(Moore 1966, Interval Analysis; Griewank & Walther 2008, Evaluating Derivatives, section 13.2; Jorba & Zou 2005,
Experimental Mathematics 14, 99)::

    (x y)_k = sum_j x_j y_(k-j)              (x/y)_k = (x_k - sum_(j>0) y_j (x/y)_(k-j))/y_0
    sin(x)_k = sum_(j>0) j x_j cos(x)_(k-j)/k        exp(x)_k = sum_(j>0) j x_j exp(x)_(k-j)/k
    tanh(x)_k = sum_(j>0) j x_j (1 - tanh(x)**2)_(k-j)/k

and those of the motion from those of the acceleration: ``v_(k+1) = a_k/(k+1)``, ``q_(k+1) = v_k/(k+1)``. ``abs(x)`` is
x or -x, by the sign of x at the start of the step, or by the sign of its rate where x is zero there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from integrators.steps.tracing import Symbol, Trace

CALLS: Mapping[str, str] = {
    **{name: f"{name}({{}})" for name in ("sin", "cos", "tanh", "exp", "log", "sqrt")}, "power": "power({}, {})"
}
"""Name of an elementary function -> the template of its call in the source."""

Name = Callable[[int], str]
Over = Callable[[str, int], str]


def divided(text: str, k: int) -> str:
    """Return the source text of a term divided by an integer k > 1, exact in numbers of any precision."""
    return f"{text}/{k}"


def times_reciprocal(text: str, k: int) -> str:
    """Return the source text of a term times the double nearest to 1/k.

    This is faster than a division, and errs by one unit in the last place.
    """
    return f"{1.0 / k!r}*{text}"



class RecurrenceWriter:
    """Writer of source lines that compute the Taylor coefficients of an acceleration's recorded operations.

    Args:
        trace: the recorded operations (the trace). In the source its leaves "t", "q" and "v" have these names, followed
            by a component's number if there are several. The rate of the time has the name ``one``.
        steady: function that returns the source text of a constant, recorded as a leaf "steady".
        accelerations: the second derivative of every component.
        calls: texts of function calls with a placeholder for the argument, as :data:`CALLS`.
        over: divides a term by a whole number: :func:`divided` or :func:`times_reciprocal`.

    Attributes:
        lines: the lines so far.
        called: names of the elementary functions that the lines call.
    """

    def __init__(
        self, trace: Trace, accelerations: Sequence[Symbol], steady: Name, calls: Mapping[str, str] = CALLS,
        over: Over = divided,
    ) -> None:
        self.trace, self.accelerations, self.steady, self.calls, self.over = trace, accelerations, steady, calls, over
        self.lines: list[str] = []
        self.called: set[str] = set()
        self.known: dict[tuple[int, int], str] = {}
        self.rates: dict[tuple[int, int], str] = {}
        self.motion: dict[tuple[str, int, int], str] = {}
        only = len(accelerations) == 1
        for name in "qv":
            for i in range(len(accelerations)):
                self.motion[name, i, 0] = name if only else f"{name}{i}"

    def write(self, order: int, highest: int) -> None:
        """Append the source lines of the Taylor coefficients of all operations and of the motion.

        Args:
            order: highest order of the coefficients of v; those of the operations are of lower order.
            highest: highest order of the coefficients of q, at most ``order + 1``.
        """
        for k in range(order):
            for place in range(len(self.trace.operations)):
                text = self._coefficient(place, k)
                if text:
                    self._keep(place, k, text)
            for i, acceleration in enumerate(self.accelerations):
                self.motion.setdefault(("q", i, 1), self.motion["v", i, 0])
                self._divide("v", i, k + 1, self._get(acceleration.place, k))
                if k + 2 <= highest:
                    self._divide("q", i, k + 2, self._v(i, k + 1))

    def coefficient(self, number: Symbol, k: int) -> str:
        """Return the name of the Taylor coefficient of order k of a recorded number; "0" if it vanishes."""
        return self.known.get((number.place, k), "0")

    def of_motion(self, name: str, i: int, k: int) -> str:
        """Return the name of the Taylor coefficient of order k of component i of ``q`` or ``v``; "0" if it vanishes."""
        return self.motion.get((name, i, k), "0")

    def _divide(self, name: str, i: int, k: int, rate: str) -> None:
        """Append the line of the Taylor coefficient of order k of component i of ``q`` or ``v``.

        It is the coefficient ``rate`` of the rate of change, divided by k.
        """
        if rate:
            self.lines.append(f"{name}{i}_{k} = {self.over(rate, k) if k > 1 else rate}")
            self.motion[name, i, k] = f"{name}{i}_{k}"

    def _v(self, i: int, k: int) -> str:
        """Return the name of the Taylor coefficient of order k of component i of v; empty if it vanishes."""
        return self.motion.get(("v", i, k), "")

    def _keep(self, place: int, k: int, text: str) -> None:
        """Store the formula of an operation's Taylor coefficient of order k.

        If the formula is more than a name, a line is appended that gives it a name.
        """
        if not text.isidentifier():
            self.lines.append(f"c{place}_{k} = {text}")
            text = f"c{place}_{k}"
        self.known[place, k] = text

    def _get(self, place: int, k: int) -> str:
        """Return the name of the Taylor coefficient of order k of an operation's result; empty if it vanishes."""
        return self.known.get((place, k), "")

    def _rate(self, place: int, k: int) -> str:
        """Return the name of ``k x_k``, which occurs in the Taylor series of a result's rate of change.

        The line that computes it is appended when it is needed for the first time.
        """
        name = self._get(place, k)
        if not name or k == 1:
            return name
        operation = self.trace.operations[place]
        if operation.name == "q":
            return self._v(operation.value, k - 1)
        if (place, k) not in self.rates:
            self.lines.append(f"r{place}_{k} = {k}*{name}")
            self.rates[place, k] = f"r{place}_{k}"
        return self.rates[place, k]

    def _products(self, pairs: Sequence[tuple[str, str]]) -> str:
        """Return the source text of a sum of products of two factors; products with an empty factor are left out."""
        return " + ".join(f"{x}*{y}" for x, y in pairs if x and y)

    def _coefficient(self, place: int, k: int) -> str:
        """Return the formula of the Taylor coefficient of order k of an operation's result; empty if it vanishes."""
        operation = self.trace.operations[place]
        name, operands = operation.name, operation.operands
        if name in ("q", "v"):
            return self.motion.get((name, operation.value, k), "")
        if name == "t":
            return ("t", "one", "")[min(k, 2)]
        if operation.steady and k:
            return ""
        if name == "steady":
            return self.steady(place)
        if k == 0 and name in self.calls:
            self.called.add(name)
            return self.calls[name].format(*(self._get(x, 0) for x in operands))
        return str(getattr(self, f"_{name}")(k, place, *operands))

    def _add(self, k: int, place: int, x: int, y: int) -> str:
        return " + ".join(filter(None, (self._get(x, k), self._get(y, k))))

    def _sub(self, k: int, place: int, x: int, y: int) -> str:
        one, other = self._get(x, k), self._get(y, k)
        return f"{one} - {other}" if one and other else f"-{other}" if other else one

    def _neg(self, k: int, place: int, x: int) -> str:
        name = self._get(x, k)
        return f"-{name}" if name else ""

    def _mul(self, k: int, place: int, x: int, y: int) -> str:
        if x != y:
            return self._products([(self._get(x, j), self._get(y, k - j)) for j in _latest_last(0, k, k)])
        twice = self._products([(self._get(x, j), self._get(x, k - j)) for j in _latest_last(0, (k - 1) // 2, k)])
        middle = self._get(x, k // 2) if k % 2 == 0 else ""
        square = f"{middle}*{middle}" if middle else ""
        return " + ".join(filter(None, (f"2*({twice})" if twice else "", square)))

    def _div(self, k: int, place: int, x: int, y: int) -> str:
        taken = self._products([(self._get(y, j), self._get(place, k - j)) for j in _latest_last(1, k, k)])
        top, bottom = self._get(x, k), self._get(y, 0)
        if taken:
            return f"({top or 0} - ({taken}))/{bottom}"
        return f"{top}/{bottom}" if top else ""

    def _abs(self, k: int, place: int, x: int) -> str:
        if k == 0:
            return f"abs({self._get(x, 0)})"
        first, then = self._get(x, 0), self._get(x, 1)
        if k == 1:
            later = f" | (({first} == 0) & ({then} >= 0))" if then else ""
            self.lines.append(f"sign{place} = 1 if ({first} > 0){later} else -1")
        name = self._get(x, k)
        return f"sign{place}*{name}" if name else ""

    def _fed(self, k: int, x: int, other: int) -> str:
        """Return the source text of ``sum_(j>0) j x_j y_(k-j)``.

        This sum occurs in the recurrences of the Taylor coefficients of sin, cos, tanh and exp.
        """
        return self._products([(self._rate(x, j), self._get(other, k - j)) for j in _latest_last(1, k, k + 1)])

    def _sin(self, k: int, place: int, x: int) -> str:
        return self._sum_over(k, self._fed(k, x, self._twin("cos", x)))

    def _cos(self, k: int, place: int, x: int) -> str:
        fed = self._fed(k, x, self._twin("sin", x))
        return f"-{self._sum_over(k, fed)}" if fed else ""

    def _exp(self, k: int, place: int, x: int) -> str:
        return self._sum_over(k, self._fed(k, x, place))

    def _tanh(self, k: int, place: int, x: int) -> str:
        return self._sum_over(k, self._fed(k, x, self._twin("slope_of_tanh", x)))

    def _slope_of_tanh(self, k: int, place: int, x: int) -> str:
        """Return the source text of the Taylor coefficient of order k of ``1 - tanh(x)**2``."""
        tanh = self._twin("tanh", x)
        square = self._mul(k, place, tanh, tanh)
        return f"1 - {square}" if k == 0 else f"-({square})" if square else ""

    def _twin(self, name: str, x: int) -> int:
        """Return the index of the recorded operation ``name`` (such as sin or cos) with the operand at index x."""
        return self.trace.places[name, (x,)]

    def _log(self, k: int, place: int, x: int) -> str:
        taken = self._products([(self._rate(place, j), self._get(x, k - j)) for j in range(1, k)])
        top = " - ".join(filter(None, (self._get(x, k) or "0", self.over(f"({taken})", k) if taken else "")))
        return f"({top})/{self._get(x, 0)}"

    def _sqrt(self, k: int, place: int, x: int) -> str:
        taken = self._products([(self._get(place, j), self._get(place, k - j)) for j in range(1, k)])
        top = " - ".join(filter(None, (self._get(x, k) or "0", f"({taken})" if taken else "")))
        return f"({top})/(2*{self._get(place, 0)})"

    def _power(self, k: int, place: int, x: int, y: int) -> str:
        """Return the source text of the Taylor coefficient of order k of ``x**y`` with a constant y.

        The recurrence is ``k x_0 (x**y)_k = sum_(j<k) (y (k - j) - j) x_(k-j) (x**y)_j``.
        """
        exponent = self._get(y, 0)
        terms = [
            f"({k - j}*{exponent} - {j})*{self._get(x, k - j)}*{self._get(place, j)}"
            for j in range(k) if self._get(x, k - j) and self._get(place, j)
        ]
        return f"({' + '.join(terms)})/({k}*{self._get(x, 0)})" if terms else ""

    def _sum_over(self, k: int, text: str) -> str:
        """Return the source text of a sum divided by k; empty for an empty sum."""
        return self.over(f"({text})", k) if text and k > 1 else f"({text})" if text else ""


def _latest_last(first: int, last: int, total: int) -> list[int]:
    """Return the indices j from ``first`` to ``last`` of a sum of products ``x_j y_(total-j)``, ordered for speed.

    Those nearest to ``total/2`` come first, as their factors are known earliest.
    """
    return sorted(range(first, last + 1), key=lambda j: max(j, total - j))
