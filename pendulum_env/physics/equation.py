"""The equation of motion to read: as text or LaTeX, with its numbers in it or their names."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import cycle

from pendulum_env.physics.effects.effect import Effect

_SYMBOLS = {
    "theta": r"\theta", "theta'": r"\dot{\theta}", "theta''": r"\ddot{\theta}", "pi": r"\pi", "sin": r"\sin",
    "cos": r"\cos", "exp": r"\exp", "log": r"\log", "sign": r"\operatorname{sign}",
}
_SIGNS = {"*": r"\,", "~": r"\,", "(": r"\left(", ")": r"\right)", ";": r";\quad", ",": r",\;"}
_TOKEN = re.compile(
    r"(?:\*\*|\^)(?P<power>-?[\d.]+|\w+|\([^()]*\))|(?P<number>\d+\.?\d*(e[+-]?\d+)?)|(?P<name>[A-Za-z]\w*'*)|(?P<sign>.)"
)


def equation_text(effects: Iterable[Effect], numbers: Mapping[str, float] | None = None) -> str:
    """``theta'' = ...``, the sum of the effects' terms, with the coefficients' values or, without, their names.

    What an effect's term has behind a comma stands at the end. Where the medium moves, drags take ``slip`` and
    ``speed``: the velocity relative to it along the path, and with what is across; u and w are the medium's velocities
    to the right and upwards. All are over the length [rad/s].
    """
    effects = tuple(effects)
    winds = {name: wind for name, role in (("u", "wind_x"), ("w", "wind_y")) if (wind := _wind(effects, role))}
    said = [_relative(e.equation) if winds and _drags(e) else e.equation for e in effects if e.equation]
    terms, clauses = [text.split(", ")[0] for text in said], [more for text in said for more in text.split(", ")[1:]]
    total = _filled(" ".join(terms), numbers).removeprefix("+ ") or "0"
    law = f"theta'' = {'-' + total[2:] if total.startswith('- ') else total}"
    where = [_filled(text, numbers) for text in (*clauses, *_slip(" ".join(said), winds))]
    return f"{law}; {', '.join(where)}" if where else law


def _filled(text: str, numbers: Mapping[str, float] | None) -> str:
    """Coefficients' values, or names, in braces' place; two signs in a row as one, and no zero added in brackets."""
    text = re.sub(r"\{(\w+)[^}]*\}", r"\1", text) if numbers is None else text.format(**numbers)
    text = re.sub(r"([+-]) -(?=[\d.])", lambda found: "+ " if found[1] == "-" else "- ", text)
    return re.sub(r" [+-] 0\)", ")", text)


def _drags(effect: Effect) -> bool:
    return effect.torque is not None and "slip" in inspect.signature(effect.torque).parameters


def _relative(term: str) -> str:
    return term.replace("|theta'|", "speed").replace("theta'", "slip")


def _wind(effects: Iterable[Effect], role: str) -> str:
    """The medium's velocity as the effects' functions have it, in the form of their equations."""
    found = []
    for effect in effects:
        if function := getattr(effect, role):
            kept = "|".join((*effect.memory, "time", "sin", "cos"))
            text = inspect.getsource(function).split("return ")[1].strip().replace(" * ", " ")
            text = re.sub(rf"\b(?!(?:{kept})\b)([a-z]\w*)", r"{\1:.6g}", text)
            found.append(re.sub(r"\btime\b", "t", text))
    return " + ".join(found)


def _slip(total: str, winds: Mapping[str, str]) -> Iterator[str]:
    """What ``slip`` and ``speed`` are, as far as they occur."""
    along = {"u": " - u cos(theta)", "w": " - w sin(theta)"}
    across = {("u",): "u sin(theta)", ("w",): "w cos(theta)", ("u", "w"): "u sin(theta) - w cos(theta)"}
    if re.search(r"\bs(lip|peed)\b", total):
        yield f"slip = theta'{''.join(along[name] for name in winds)}"
        if re.search(r"\bspeed\b", total):
            yield f"speed**2 = slip**2 + ({across[tuple(winds)]})**2"
        yield from (f"{name} = {wind}" for name, wind in winds.items())


def latex(text: str) -> str:
    r"""An equation's text in LaTeX, without dollar signs: ``1.2e-05 theta'`` is ``1.2 \times 10^{-5}\,\dot{\theta}``.

    Known are numbers, names, ``+ - * /``, round brackets, the bars of absolute values, and ``**`` or ``^`` with a
    number, a name or brackets. Names of several letters are set upright; what follows the underscore of one letter is
    its index.
    """
    bars = cycle((r"\left|", r"\right|"))
    text = re.sub(r"\b(sin|cos)\(theta\)", r"\1 theta", text)
    text = re.sub(r"(?<=[\w)'|]) (?=[\w(|])(?!\|[ )])(?<!sin )(?<!cos )", "~", text)
    found = []
    for match in _TOKEN.finditer(text):
        kind, token = match.lastgroup, match[0]
        if kind == "power":
            found.append(f"^{{{latex(match['power'].strip('()'))}}}")
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
