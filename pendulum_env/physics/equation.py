"""The equation of motion to read: as text or LaTeX, with its numbers in it or their names."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping
from itertools import cycle

from pendulum_env.physics.effects.effect import Effect

SLIP = "slip = theta' - u cos(theta) - w sin(theta)"
"""The bob's velocity relative to a medium that moves with u to the right and w upwards, over the length."""

_SYMBOLS = {
    "theta": r"\theta", "theta'": r"\dot{\theta}", "theta''": r"\ddot{\theta}", "pi": r"\pi", "sin": r"\sin",
    "cos": r"\cos", "exp": r"\exp", "log": r"\log", "sign": r"\operatorname{sign}",
}
_SIGNS = {"*": r"\,", "~": r"\,", "(": r"\left(", ")": r"\right)", ";": r";\quad"}
_TOKEN = re.compile(
    r"\*\*(?P<power>-?[\d.]+|\w+)|(?P<number>\d+\.?\d*(e[+-]?\d+)?)|(?P<name>[A-Za-z]\w*'*)|(?P<sign>.)"
)


def equation_text(effects: Iterable[Effect], numbers: Mapping[str, float] | None = None) -> str:
    """``theta'' = ...``, the sum of the effects' terms, with the coefficients' values or, without, their names.

    Where the medium moves, what drags take is ``slip`` and ``speed`` relative to it.
    """
    effects = tuple(effects)
    moving = any(effect.wind_x or effect.wind_y for effect in effects)
    terms = [effect.equation for effect in effects if effect.equation]
    dragged = {effect.equation for effect in effects if moving and _drags(effect)}
    terms = [_relative(term) if term in dragged else term for term in terms]
    if numbers is None:
        filled = [re.sub(r"\{(\w+)[^}]*\}", r"\1", term) for term in terms]
    else:
        filled = [term.format(**numbers) for term in terms]
    total = _tidy(" ".join(filled)).removeprefix("+ ") or "0"
    return f"theta'' = {'-' + total[2:] if total.startswith('- ') else total}{f'; {SLIP}' if dragged else ''}"


def _drags(effect: Effect) -> bool:
    return effect.torque is not None and "slip" in inspect.signature(effect.torque).parameters


def _relative(term: str) -> str:
    return term.replace("|theta'|", "speed").replace("theta'", "slip")


def _tidy(terms: str) -> str:
    """Two signs in a row as one, and no zero added inside brackets."""
    terms = re.sub(r"([+-]) -(?=[\d.])", lambda found: "+ " if found[1] == "-" else "- ", terms)
    return re.sub(r" [+-] 0\)", ")", terms)


def latex(text: str) -> str:
    r"""An equation's text in LaTeX, without dollar signs: ``1.2e-05 theta'`` is ``1.2 \times 10^{-5}\,\dot{\theta}``.

    Known are numbers, names, ``+ - * /``, round brackets, the bars of absolute values, and ``**`` with a number or a
    name. Names of several letters are set upright; what follows the underscore of one letter is its index.
    """
    bars = cycle((r"\left|", r"\right|"))
    text = re.sub(r"\b(sin|cos)\(theta\)", r"\1 theta", text)
    text = re.sub(r"(?<=[\w)'|]) (?=[\w(|])(?!\|[ )])(?<!sin )(?<!cos )", "~", text)
    found = []
    for match in _TOKEN.finditer(text):
        kind, token = match.lastgroup, match[0]
        if kind == "power":
            found.append(f"^{{{latex(match['power'])}}}")
        elif kind == "number":
            digits, _, power = token.partition("e")
            found.append(rf"{digits} \times 10^{{{int(power)}}}" if power else digits)
        elif kind == "name":
            found.append(_SYMBOLS.get(token) or _name(token))
        else:
            found.append(next(bars) if token == "|" else _SIGNS.get(token, token))
    return "".join(found)


def _name(token: str) -> str:
    if len(token) == 1:
        return token
    if token[1] == "_":
        return rf"{token[0]}_{{\mathrm{{{token[2:]}}}}}"
    return rf"\mathrm{{{token}}}".replace("_", r"\_")
