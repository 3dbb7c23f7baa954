"""Taylor coefficients of a motion from the operations of its acceleration: straight lines of source.

With ``x = sum_k x_k h**k``, each operation's coefficient of order k follows from those of its operands up to k
(Moore 1966, Interval Analysis; Griewank & Walther 2008, Evaluating Derivatives, section 13.2; Jorba & Zou 2005,
Experimental Mathematics 14, 99)::

    (x y)_k = sum_j x_j y_(k-j)              (x/y)_k = (x_k - sum_(j>0) y_j (x/y)_(k-j))/y_0
    sin(x)_k = sum_(j>0) j x_j cos(x)_(k-j)/k        exp(x)_k = sum_(j>0) j x_j exp(x)_(k-j)/k

and the motion's own from the acceleration's: ``v_(k+1) = a_k/(k+1)``, ``q_(k+1) = v_k/(k+1)``. ``abs(x)`` is x or -x,
by the sign of x there; where x is zero by that of its rate, which is what it becomes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from integrators.steps.tracing import Trace, Traced

CALLS: Mapping[str, str] = {
    **{name: f"{name}({{}})" for name in ("sin", "cos", "exp", "log", "sqrt")}, "power": "power({}, {})"
}
"""How functions are called in the source."""

Name = Callable[[int], str]
Over = Callable[[str, int], str]


def divided(text: str, k: int) -> str:
    """A term over k > 1, in any numbers."""
    return f"{text}/{k}"


def times_reciprocal(text: str, k: int) -> str:
    """The same in floats, within an ulp of it: a division takes as long as ten products."""
    return f"{1.0 / k!r}*{text}"



class Writer:
    """Writes the coefficients of one trace, order by order.

    Args:
        trace: the operations; its leaves "t", "q" and "v" are named t, q and v, with a component's number if there is
            more than one. The time's rate is named one.
        steady: writes what a leaf "steady" holds.
        accelerations: the second derivative of each component.
        calls: as :data:`CALLS`.
        over: writes a term over a whole number, :func:`divided` or :func:`times_reciprocal`.

    Attributes:
        lines: what has been written.
        called: names of the functions that it calls.
    """

    def __init__(
        self, trace: Trace, accelerations: Sequence[Traced], steady: Name, calls: Mapping[str, str] = CALLS,
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
        """Coefficients of the operations below ``order``, of v up to it, of q up to ``highest``, order + 1 at most."""
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

    def coefficient(self, number: Traced, k: int) -> str:
        """The name of a coefficient, "0" where there is none."""
        return self.known.get((number.place, k), "0")

    def of_motion(self, name: str, i: int, k: int) -> str:
        """The same for a component of q or v."""
        return self.motion.get((name, i, k), "0")

    def _divide(self, name: str, i: int, k: int, rate: str) -> None:
        """A component's coefficient from that of its rate."""
        if rate:
            self.lines.append(f"{name}{i}_{k} = {self.over(rate, k) if k > 1 else rate}")
            self.motion[name, i, k] = f"{name}{i}_{k}"

    def _v(self, i: int, k: int) -> str:
        return self.motion.get(("v", i, k), "")

    def _keep(self, place: int, k: int, text: str) -> None:
        """Give the coefficient a name, unless it is one."""
        if not text.isidentifier():
            self.lines.append(f"c{place}_{k} = {text}")
            text = f"c{place}_{k}"
        self.known[place, k] = text

    def _get(self, place: int, k: int) -> str:
        return self.known.get((place, k), "")

    def _rate(self, place: int, k: int) -> str:
        """``k x_k``."""
        found = self._get(place, k)
        if not found or k == 1:
            return found
        operation = self.trace.operations[place]
        if operation.name == "q":
            return self._v(operation.value, k - 1)
        if (place, k) not in self.rates:
            self.lines.append(f"r{place}_{k} = {k}*{found}")
            self.rates[place, k] = f"r{place}_{k}"
        return self.rates[place, k]

    def _products(self, pairs: Sequence[tuple[str, str]]) -> str:
        return " + ".join(f"{x}*{y}" for x, y in pairs if x and y)

    def _coefficient(self, place: int, k: int) -> str:
        """The formula of a coefficient, "" where it vanishes."""
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
        found = self._get(x, k)
        return f"-{found}" if found else ""

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
        found = self._get(x, k)
        return f"sign{place}*{found}" if found else ""

    def _fed(self, k: int, x: int, other: int) -> str:
        """``sum_(j>0) j x_j y_(k-j)``."""
        return self._products([(self._rate(x, j), self._get(other, k - j)) for j in _latest_last(1, k, k + 1)])

    def _sin(self, k: int, place: int, x: int) -> str:
        return self._sum_over(k, self._fed(k, x, self._twin("cos", x)))

    def _cos(self, k: int, place: int, x: int) -> str:
        fed = self._fed(k, x, self._twin("sin", x))
        return f"-{self._sum_over(k, fed)}" if fed else ""

    def _exp(self, k: int, place: int, x: int) -> str:
        return self._sum_over(k, self._fed(k, x, place))

    def _twin(self, name: str, x: int) -> int:
        return self.trace.places[name, (x,)]

    def _log(self, k: int, place: int, x: int) -> str:
        taken = self._products([(self._rate(place, j), self._get(x, k - j)) for j in range(1, k)])
        found = " - ".join(filter(None, (self._get(x, k) or "0", self.over(f"({taken})", k) if taken else "")))
        return f"({found})/{self._get(x, 0)}"

    def _sqrt(self, k: int, place: int, x: int) -> str:
        taken = self._products([(self._get(place, j), self._get(place, k - j)) for j in range(1, k)])
        found = " - ".join(filter(None, (self._get(x, k) or "0", f"({taken})" if taken else "")))
        return f"({found})/(2*{self._get(place, 0)})"

    def _power(self, k: int, place: int, x: int, y: int) -> str:
        """``k x_0 (x**y)_k = sum_(j<k) (y (k - j) - j) x_(k-j) (x**y)_j``."""
        exponent = self._get(y, 0)
        terms = [
            f"({k - j}*{exponent} - {j})*{self._get(x, k - j)}*{self._get(place, j)}"
            for j in range(k) if self._get(x, k - j) and self._get(place, j)
        ]
        return f"({' + '.join(terms)})/({k}*{self._get(x, 0)})" if terms else ""

    def _sum_over(self, k: int, text: str) -> str:
        """A sum over k; "" for an empty one."""
        return self.over(f"({text})", k) if text and k > 1 else f"({text})" if text else ""


def _latest_last(first: int, last: int, total: int) -> list[int]:
    """``first`` to ``last``, j and ``total - j`` near each other first: a processor adds these while it waits."""
    return sorted(range(first, last + 1), key=lambda j: max(j, total - j))
