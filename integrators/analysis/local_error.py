"""Leading error terms of methods on the harmonic oscillator, by Taylor expansion of their exact coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from integrators.analysis.linear import step_matrix
from integrators.analysis.multistep_linear import growth_and_detuning, local_errors
from integrators.analysis.series import PowerSeries, cosine, sine
from integrators.method import Method
from integrators.registry import named


@dataclass(frozen=True)
class Term:
    """One term ``coefficient h**power`` of an expansion in the step h, with an exact coefficient."""

    coefficient: Fraction
    power: int


@dataclass(frozen=True)
class LeadingError:
    """Leading error terms of a method on ``theta'' = -omega0**2 theta``; a term is None where there is no error.

    Attributes:
        method: name of the method.
        angle: error of the angle in one step, computed minus exact: ``coefficient h**power theta^(power)`` with the
            derivative of that order.
        velocity: error of the velocity in one step: ``coefficient h**power velocity^(power)``.
        amplitude: after a time t the amplitude is ``exp(coefficient omega0 (omega0 h)**power t)`` times too large.
        frequency: the frequency is ``coefficient (omega0 h)**power`` too high, relative to omega0.
    """

    method: str
    angle: Term | None
    velocity: Term | None
    amplitude: Term | None
    frequency: Term | None

    @property
    def text(self) -> str:
        """Local error, amplitude error and frequency error as one line of plain text, for a table cell."""
        step = "error of the angle in a step: 0"
        if self.angle is not None:
            n = self.angle.power
            derivative = "theta" + ("'" * n if n <= 3 else f"^({n})")
            step = f"error of the angle in a step: {_plain(self.angle.coefficient, f'h^{n} {derivative}')}"
        amplitude, frequency = "amplitude exact", "frequency exact"
        if self.amplitude is not None:
            p = self.amplitude.power
            rate = _plain(self.amplitude.coefficient, f"omega0^{p + 1} {_power('h', p)} t")
            amplitude = f"amplitude after a time t: times exp({rate})"
        if self.frequency is not None:
            shift = _plain(self.frequency.coefficient, _power("(omega0 h)", self.frequency.power))
            frequency = f"frequency: {shift} of its value"
        return "; ".join((step, amplitude, frequency))

    @property
    def latex(self) -> str:
        """Local error, amplitude error and frequency error in LaTeX math without dollar signs, for Matplotlib."""
        step, amplitude, frequency = (r"\delta\theta = 0", r"\delta A = 0", r"\delta\omega = 0")
        if self.angle is not None:
            n = self.angle.power
            derivative = r"\theta" + ("'" * n if n <= 3 else f"^{{({n})}}")
            step = rf"\delta\theta = {_fraction(self.angle.coefficient)}\,h^{{{n}}}{derivative}"
        if self.amplitude is not None:
            p = self.amplitude.power
            rate = rf"{_fraction(self.amplitude.coefficient)}\,\omega_0^{{{p + 1}}}{_power('h', p, '{}')}\,t"
            amplitude = rf"A \propto \exp\left({rate}\right)"
        if self.frequency is not None:
            shift = _power(r"(\omega_0 h)", self.frequency.power, "{}")
            frequency = rf"\delta\omega/\omega_0 = {_fraction(self.frequency.coefficient)}\,{shift}"
        return r",\quad ".join((step, amplitude, frequency))


def leading_error(method: str | Method) -> LeadingError:
    """Return a method's leading errors on the oscillator: of one step, and of amplitude and frequency in long runs.

    With the step's matrix M(z), the local error is ``M - [[cos z, sin z], [-sin z, cos z]]``. M's eigenvalues
    ``r exp(+-i phi)`` give the growth per time ``omega0 log(r)/z`` and the frequency ``omega0 phi/z``
    (Hairer, Lubich & Wanner 2006, section I.1; for Runge-Kutta methods ``r exp(i phi) = R(iz)``). A multistep method
    takes the step from an exact history, and its principal root, which approximates ``exp(iz)``, is the eigenvalue.

    Raises MethodError for an unknown name.
    """
    chosen = named(method)
    if not chosen.one_step:
        a, b, c, d = local_errors(chosen, chosen.order + 4)
        least = chosen.rounding
        angle = _lowest(_derivative_term(a, +1, least), _derivative_term(b, +1, least))
        velocity = _lowest(_derivative_term(d, +1, least), _derivative_term(c, -1, least))
        amplitude, frequency = (_term(series, least) for series in growth_and_detuning(chosen))
        return LeadingError(chosen.name, angle, velocity, amplitude, frequency)
    exactly = step_matrix(chosen)
    full = len(exactly[0].c)
    for terms in (min(chosen.order + 6, full), full):
        errors = _leading(chosen.name, chosen.rounding, *(entry.head(terms) for entry in exactly))
        if None not in (errors.angle, errors.velocity, errors.frequency, errors.amplitude or chosen.symplectic or None):
            break
    return errors


def _leading(name: str, least: Fraction, *matrix: PowerSeries) -> LeadingError:
    """Return the leading errors from the oscillator matrix of a step (four numerators and their denominator)."""
    *numerators, scale = matrix
    a, b, c, d = (entry / scale for entry in numerators)
    cos, sin = cosine(len(a.c)), sine(len(a.c))
    angle = _lowest(_derivative_term(a - cos, +1, least), _derivative_term(b - sin, +1, least))
    velocity = _lowest(_derivative_term(d - cos, +1, least), _derivative_term(c + sin, -1, least))

    det, x = a * d - b * c, (a + d) / 2
    root = (det - x * x).over_z(2).sqrt()
    y = PowerSeries.variable(len(root.c)) * root
    det, x = det.head(len(y.c)), x.head(len(y.c))
    log_modulus = (det.derivative() / det / 2).integral()
    argument = ((x * y.derivative() - y * x.derivative()) / det).integral()
    amplitude, frequency = log_modulus.over_z(), argument.over_z() - 1
    return LeadingError(name, angle, velocity, _term(amplitude, least), _term(frequency, least))


def _derivative_term(error: PowerSeries, sign: int, least: Fraction) -> Term | None:
    """Convert the first term of an error series in ``z = omega0 h`` to a term in derivatives of the motion.

    Two derivatives bring a factor ``-omega0**2``. ``sign`` is -1 for the error that the angle causes in the velocity,
    since the angle is minus the derivative of the velocity, and +1 for all other entries of the step's matrix.
    """
    first = error.leading(least)
    if first is None:
        return None
    x, k = first
    return Term(x * (-1) ** (k // 2) * (sign if k % 2 else 1), k)


def _lowest(*terms: Term | None) -> Term | None:
    """Return the error term with the lowest power of h; None if all terms are None."""
    return min((term for term in terms if term is not None), key=lambda term: term.power, default=None)


def _term(series: PowerSeries, least: Fraction) -> Term | None:
    """Return the first term of an error series whose coefficient exceeds ``least``; None if there is none."""
    first = series.leading(least)
    return None if first is None else Term(*first)


def _power(base: str, power: int, braces: str = "") -> str:
    """Return a power of ``base`` as text, such as ``h^2``; with ``braces`` as LaTeX, such as ``h^{2}``."""
    if power == 1:
        return base
    return f"{base}^{{{power}}}" if braces else f"{base}^{power}"


def _decimal(size: Fraction) -> bool:
    """Return True if a fraction's numerator or denominator exceeds a million: it is then shown as a decimal."""
    return size.denominator > 10**6 or size.numerator > 10**6


def _plain(coefficient: Fraction, body: str) -> str:
    """Return a coefficient times a text as plain text with an explicit sign, such as ``+3 h^2/4``."""
    sign, size = "-" if coefficient < 0 else "+", abs(coefficient)
    if _decimal(size):
        return f"{sign}{float(size):.4g} {body}"
    factor = "" if size.numerator == 1 else f"{size.numerator} "
    return f"{sign}{factor}{body}" + ("" if size.denominator == 1 else f"/{size.denominator}")


def _fraction(coefficient: Fraction) -> str:
    """Return a coefficient in LaTeX with an explicit sign."""
    sign, size = "-" if coefficient < 0 else "+", abs(coefficient)
    if _decimal(size):
        return f"{sign}{float(size):.4g}"
    if size.denominator == 1:
        return f"{sign}{size.numerator}"
    return rf"{sign}\frac{{{size.numerator}}}{{{size.denominator}}}"
