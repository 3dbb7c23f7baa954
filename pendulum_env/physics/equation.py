"""The equation of motion as text, LaTeX or MathML, with its coefficients as numbers or as names."""

from __future__ import annotations

import ast
import copy
import inspect
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from itertools import accumulate, cycle

from pendulum_env.common.checks import printable
from pendulum_env.common.mathml import LETTERS, mathml
from pendulum_env.common.sources import ReadingError, source_of
from pendulum_env.physics.effects.effect import Effect

_SYMBOLS = {
    "theta": r"\theta", "theta'": r"\dot{\theta}", "theta''": r"\ddot{\theta}", "pi": r"\pi", "sin": r"\sin",
    "cos": r"\cos", "exp": r"\exp", "log": r"\log", "sign": r"\operatorname{sign}",
}
_SIGNS = {"*": r"\,", "~": r"\,", ";": r";\quad", ",": r",\;", "\\": r"\backslash ", "^": r"\wedge ",
          '"': "\N{RIGHT DOUBLE QUOTATION MARK}", "'": r"{}^{\prime}", **{sign: rf"\{sign}" for sign in "%$#&_{}"}}
_TOKEN = re.compile(
    r"(?:\*\*|\^)(?P<power>-?[\d.]+|\w+|\([^()]*\))|(?P<number>\d+\.?\d*(e[+-]?\d+)?)|(?P<name>[A-Za-z]\w*'*)|(?P<sign>.)"
)

_FIELD = re.compile(r"\{\{|\}\}|\{(?P<name>\w+)(?::(?P<form>[^{}]*))?\}")
_UPRIGHT = {"sin": '" "sin', "cos": '" "cos', "exp": '" "exp', "log": '" "ln', "Re": "Re"}
_FENCE = 'stretchy="false" lspace="0" rspace="0"'
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def equation_text(effects: Iterable[Effect], numbers: Mapping[str, float] | None = None) -> str:
    """Return the equation of motion ``theta'' = ...``, the sum of the effects' terms.

    Coefficients appear as their values from ``numbers``, or as their names without ``numbers``. Text behind a comma in
    an effect's term is moved to the end. Where the medium moves, drags take ``slip`` and ``speed``: the bob's velocity
    relative to the medium along its path, and the size of the whole relative velocity, with the part across the path. u
    and w are the medium's velocities to the right and upwards. All are divided by the length [rad/s].
    """
    effects = tuple(effects)
    winds = {name: wind for name, role in (("u", "wind_x"), ("w", "wind_y")) if (wind := _wind(effects, role))}
    equations = [_relative(e.equation) if winds and _drags(e) else e.equation for e in effects if e.equation]
    terms = [text.split(", ")[0] for text in equations]
    clauses = [more for text in equations for more in text.split(", ")[1:]]
    terms_sum = _filled(" ".join(filter(None, terms)), numbers).removeprefix("+ ") or "0"
    law = f"theta'' = {'-' + terms_sum[2:] if terms_sum.startswith('- ') else terms_sum}"
    where = [_filled(text, numbers) for text in (*clauses, *_slip(" ".join(equations), winds))]
    whole = f"{law}; {', '.join(where)}" if where else law
    return printable(whole)


def _filled(text: str, numbers: Mapping[str, float] | None) -> str:
    """Return an equation's text with coefficients, in braces, replaced by values or, without ``numbers``, by names.

    Braces around anything else are text like the rest. Two signs in a row are merged, and zeros added before a closing
    bracket are dropped.
    """
    text = _FIELD.sub(lambda field: _value(field, numbers), text)
    text = re.sub(r"([+-]) -(?=[\d.])", lambda sign: "+ " if sign[1] == "-" else "- ", text)
    return re.sub(r" [+-] 0\)", ")", text)


def _value(field: re.Match[str], numbers: Mapping[str, float] | None) -> str:
    """Return what stands for a coefficient in braces: its name, or its value in the given format."""
    name, form = field["name"], field["form"] or ""
    if name is None:
        return field[0][0]  # of two braces, one
    if numbers is None:
        return name
    try:
        return format(numbers[name], form)
    except (KeyError, ValueError):
        return field[0]


def _drags(effect: Effect) -> bool:
    """Return True if an effect is a drag, which acts on the velocity relative to the medium."""
    return effect.torque is not None and "slip" in inspect.signature(effect.torque).parameters


def _relative(term: str) -> str:
    """Return a drag's term of the equation of motion with the velocity relative to the medium in place of the velocity.
    """
    return term.replace("|theta'|", "speed").replace("theta'", "slip")


def _wind(effects: Iterable[Effect], role: str) -> str:
    """Return one component of the medium's velocity as a formula in text, read from the source code of the effects'
    functions.

    ``role`` is "wind_x" for the component to the right or "wind_y" for the upward one.
    """
    winds = []
    for effect in effects:
        if function := getattr(effect, role):
            winds.append(_formula(function, effect.memory))
    return " + ".join(winds)


def _formula(function: Callable[..., float], memory: Collection[str]) -> str:
    """Return the value of a function as text with coefficients to fill in; its call if it is more than one formula."""
    try:
        body = [line for line in source_of(function).body if not isinstance(line, ast.Expr)]
    except ReadingError:
        body = []
    if len(body) != 1 or not isinstance(body[0], ast.Return) or body[0].value is None:
        return f"{function.__name__}(t)"
    value = copy.deepcopy(body[0].value)
    called = {id(node.func) for node in ast.walk(value) if isinstance(node, ast.Call)}
    for node in ast.walk(value):
        if isinstance(node, ast.Name) and id(node) not in called and node.id not in memory:
            node.id = "t" if node.id == "time" else f"{{{node.id}:.6g}}"
    return ast.unparse(value).replace(" * ", " ")


def _slip(total: str, winds: Mapping[str, str]) -> Iterator[str]:
    """Yield the definitions, as text, of ``slip``, ``speed`` and the wind's velocities that an equation uses.

    ``total`` is the text of the equation's terms, ``winds`` the formulas of the wind's velocities u and w.
    """
    along = {"u": " - u cos(theta)", "w": " - w sin(theta)"}
    across = {("u",): "u sin(theta)", ("w",): "w cos(theta)", ("u", "w"): "u sin(theta) - w cos(theta)"}
    if re.search(r"\bs(lip|peed)\b", total):
        yield f"slip = theta'{''.join(along[name] for name in winds)}"
        if re.search(r"\bspeed\b", total):
            yield f"speed**2 = slip**2 + ({across[tuple(winds)]})**2"
        yield from (f"{name} = {wind}" for name, wind in winds.items())


def latex(text: str) -> str:
    r"""Return an equation's text as LaTeX, without dollar signs.

    ``1.2e-05 theta'`` becomes ``1.2 \times 10^{-5}\,\dot{\theta}``. Supported are numbers, names, ``+ - * /``, round
    brackets, the bars of absolute values, and ``**`` or ``^`` with a number, a name or brackets. Names of several
    letters are set upright; text behind the underscore of one letter is its index.
    """
    # Brackets and bars that have no partner cannot grow.
    bars = cycle((r"\left|", r"\right|") if text.count("|") % 2 == 0 else "|")
    brackets = {"(": r"\left(", ")": r"\right)"} if _paired(text) else {}
    text = re.sub(r"\b(sin|cos)\(theta\)", r"\1 theta", text)
    text = re.sub(r"(?<=[\w)'|]) (?=[\w(|])(?!\|[ )])(?<!sin )(?<!cos )", "~", text)
    parts = []
    for match in _TOKEN.finditer(text):
        kind, token = match.lastgroup, match[0]
        if kind == "power":
            parts.append(f"^{{{latex(match['power'].strip('()'))}}}")
        elif kind == "number":
            digits, _, power = token.partition("e")
            parts.append(rf"{digits} \times 10^{{{int(power)}}}" if power else digits)
        elif kind == "name":
            parts.append(_SYMBOLS.get(token) or _name(token))
        else:
            parts.append(next(bars) if token == "|" else brackets.get(token) or _SIGNS.get(token, token))
    return "".join(parts)


def _paired(text: str) -> bool:
    """Return True if every bracket in a text has its partner."""
    depth = list(accumulate((sign == "(") - (sign == ")") for sign in text))
    return not depth or (min(depth) >= 0 == depth[-1])


def equation_mathml(text: str) -> str:
    """Return an equation's text as a MathML element: the law, and one row below it for each definition.

    Supported is what :func:`latex` supports. Names that are no symbols, such as ``control``, are set upright.
    """
    lines = text.replace("; ", ", ").split(", ")
    made = mathml("\n".join(_short(line).replace(" = ", " & = ", 1) for line in lines), block=True)
    return made.replace("<mo>|<", f"<mo {_FENCE}>|<").replace("<mo>(<", f"<mo {_FENCE}>(<").replace(
        "<mo>)<", f"<mo {_FENCE}>)<")


def _short(text: str) -> str:
    """Return an equation's text in the short notation of :mod:`pendulum_env.common.mathml`."""
    parts = []
    for match in _TOKEN.finditer(text):
        kind, token = match.lastgroup, match[0]
        if kind == "power":
            parts.append(f"^{{{_short(match['power'].strip('()'))}}}")
        elif kind == "number":
            digits, _, power = token.partition("e")
            parts.append(f"{digits}\N{MULTIPLICATION SIGN}10{str(int(power)).translate(_RAISED)}" if power else digits)
        elif kind == "name":
            name = token.rstrip("'")
            known = name in LETTERS or len(name) == 1 or (name[1:2] == "_" and len(name) == 3)
            parts.append(_UPRIGHT.get(name) or (token if known else f'"{name}"{token[len(name):]}'))
        else:
            token = _SIGNS['"'] if token == '"' else token
            parts.append(f'"{token}"' if token in "{}_^&'" else token)
    return "".join(parts)


def _name(token: str) -> str:
    """Return the LaTeX of a name that is not a known symbol."""
    if len(token) == 1:
        return token
    if token[1] == "_":
        return rf"{token[0]}_{{\mathrm{{{token[2:]}}}}}"
    return rf"\mathrm{{{token}}}".replace("_", r"\_")
