"""Adams methods: Adams-Bashforth formulas, which extrapolate earlier accelerations, and a predictor-corrector pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from integrators.families.multistep import HNW, RK4, Started, ago, falling, starter_of
from integrators.method import MethodError, Polynomial, exact
from integrators.steps.terms import Notation, combination, increment


@dataclass(frozen=True, kw_only=True)
class Adams(Started):
    """An Adams method: the state plus h times a weighted sum of the slopes of this step and earlier ones.

    ``y1 = y + h sum_j b_j f_(n-j)``. With a corrector (PECE) this is the prediction, and
    ``y1 = y + h (corrector_0 f(predicted) + sum_j corrector_(j+1) f_(n-j))``; the next step uses the slope at ``y1``.
    Raises MethodError if the weights do not sum to one.

    Attributes:
        b: weights of the slopes, that of the newest first.
        corrector: weights of the slope at the prediction and of the slopes before it; () for no corrector.
    """

    b: tuple[Fraction, ...]
    corrector: tuple[Fraction, ...] = ()

    coefficients: ClassVar[tuple[str, ...]] = ("b", "corrector")

    def __post_init__(self) -> None:
        super().__post_init__()
        for label, row in (("b", self.b), ("corrector", self.corrector)):
            if row and sum(row) != 1:
                raise MethodError(f"{self.name}: the weights {label} sum to {sum(row)}, not to 1.")

    @property
    def first_order_form(self) -> bool:
        return True

    @property
    def memory(self) -> tuple[str, ...]:
        return self.memory_with()

    def memory_with(self, quadratures: Sequence[str] = ()) -> tuple[str, ...]:
        return ago(("v", "a", *quadratures), range(1, self.past + 1))

    @property
    def past(self) -> int:
        return max(len(self.b) - 1, len(self.corrector) - 2)

    @property
    def evaluations(self) -> int:
        return 2 if self.corrector else 1

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        k = self.past
        top = [Fraction(0)] * (k + 2)
        top[k + 1], top[k] = Fraction(1), Fraction(-1)
        if not self.corrector:
            return tuple(top), falling(self.b, k)
        last, *rest = self.corrector
        once = list(falling(rest, k))
        once[k] -= last
        return tuple(top), tuple(once), tuple(last * x for x in falling(self.b, k))

    def write_step(self, notation: Notation) -> str:
        more, number = notation.more, notation.number
        names = ("v", "a", *notation.quadratures)
        rows = {name: [name, *ago((name,), range(1, self.past + 1))] for name in names}
        step, b = notation.new_step(), self.b
        step.line(f"{', '.join(names[1:])} = {notation.slope}(t, q, v{more})")
        if self.corrector:
            b = self.corrector
            predicted = [step.sum(y, increment(self.b, rows[slope][: len(self.b)]))
                         for y, slope in (("q", "v"), ("v", "a"))]
            step.line(f"v_new = {predicted[1]}")
            slopes = ", ".join(f"{name}_new" for name in names[1:])
            step.line(f"{slopes} = {notation.slope}(t + h, {predicted[0]}, v_new{more})")
        used = {name: [*([f"{name}_new"] if self.corrector else []), *row][: len(b)] for name, row in rows.items()}
        ends = [step.end(y, increment(b, used[slope])) for y, slope in (("q", "v"), ("v", "a"))]
        kept = [name for row in rows.values() for name in row[:-1]]
        increments = [f"h*({combination(b, used[name], number)})" for name in notation.quadratures]
        begin = self.begin_backwards(notation, speeds=ago("v", range(1, self.past + 1)))
        return self.write_starter(notation) + self.define(begin, step, ends, kept, increments)


def _adams(order: int, *b: str) -> Adams:
    """Return the Adams-Bashforth method of this order; ``b`` are its weights, that of the newest slope first."""
    return Adams(
        name=f"ab{order}",
        aliases=(f"adams_bashforth{order}",),
        order=order,
        source=f"Bashforth & Adams 1883, Theories of Capillary Action; {HNW}, III.1",
        summary=f"extrapolates the accelerations of the last {order} steps: one force evaluation per step",
        b=exact(*b),
        starter=starter_of(order),
    )


ADAMS = (
    _adams(2, "3/2", "-1/2"),
    _adams(3, "23/12", "-4/3", "5/12"),
    _adams(4, "55/24", "-59/24", "37/24", "-3/8"),
    _adams(5, "1901/720", "-1387/360", "109/30", "-637/360", "251/720"),
    _adams(6, "4277/1440", "-2641/480", "4991/720", "-3649/720", "959/480", "-95/288"),
    Adams(
        name="abm4",
        aliases=("adams_bashforth_moulton4",),
        order=4,
        source=f"Moulton 1926, New Methods in Exterior Ballistics; {HNW}, III.1 (PECE)",
        summary="ab4 corrected by the implicit Adams method of four slopes: two force evaluations per step",
        b=exact("55/24", "-59/24", "37/24", "-3/8"),
        corrector=exact("3/8", "19/24", "-5/24", "1/24"),
        starter=RK4,
    ),
)
