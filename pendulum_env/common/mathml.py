"""Equations as MathML, from a short notation in plain letters.

    mathml("Omega = frac{2 pi}{T} = sqrt{frac{g}{L}}")

Greek letters, ``times``, ``pm`` and the like are written by name; other single letters are variables; texts such as
units stand in quotation marks. ``_`` and ``^`` take the next item, or several in braces; ``frac`` takes two groups in
braces, ``sqrt`` one. Numbers have a decimal point or comma, apostrophes are primes. In a block, every line is a row,
and ``&`` aligns the rows.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape

LETTERS = ("gamma", "Delta", "delta", "theta", "mu", "pi", "rho", "omega", "Omega")
"""Greek letters, by the names that HTML has for them."""
SIGNS = {"times": "times", "approx": "asymp", "pm": "plusmn", "le": "le", "dots": "hellip", "prop": "prop"}
"""Operators, and the names that HTML has for them."""
FUNCTIONS = ("sin", "cos", "ln", "exp", "Re")
"""Names that are set upright."""
SPACE = '<mspace width="0.2em"></mspace>'
"""Space before a text, such as a unit, and behind a function's name."""
TOKEN = re.compile(r'\s*("[^"]*"|\d[\d.]*(?:,\d+)?(?:\u00d710[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?|[A-Za-z]+|\'+|\S)')
PRIMES = {1: "&prime;", 2: "&Prime;", 3: "&tprime;"}


class NotationError(ValueError):
    """Error of an equation in the short notation: an unknown word, or a group that is missing or not closed."""


def mathml(text: str, block: bool = False) -> str:
    """Return an equation as a MathML element, inline or as a block of aligned rows.

    Raises NotationError for an unknown word, and for braces that do not match.
    """
    if not block:
        return f"<math>{row(text)}</math>"
    lines = [line.split("&") for line in text.strip().splitlines() if line.strip()]
    rows = "".join(f"<mtr>{''.join(map(cell, range(len(parts)), parts))}</mtr>" for parts in lines)
    return f'<math display="block"><mtable displaystyle="true">{rows}</mtable></math>'


def cell(place: int, text: str) -> str:
    """Return the MathML of one column of a row: the first column ends, and the others begin, where they meet."""
    return f'<mtd style="text-align: {"left" if place else "right"}">{row(text)}</mtd>'


def row(text: str) -> str:
    """Return the MathML of one line without alignment."""
    tokens = [found[1] for found in TOKEN.finditer(text.strip())]
    items = list(reading(tokens))
    if tokens:
        raise NotationError(f"the equation has a '}}' too much: {text.strip()!r}")
    return f"<mrow>{''.join(items)}</mrow>"


def reading(tokens: list[str]) -> Iterator[str]:
    """Yield the MathML of items, with their indices and powers, up to a closing brace; the tokens are consumed."""
    while tokens and tokens[0] != "}":
        base = item(tokens)
        below, power, primes = "", "", ""
        while tokens and (tokens[0] in ("_", "^") or tokens[0].startswith("'")):
            sign = tokens.pop(0)
            if sign == "_":
                below = item(tokens)
            elif sign == "^":
                power = item(tokens)
            else:
                primes = f'<mo lspace="0" rspace="0">{PRIMES[len(sign)]}</mo>'
        base += primes
        if below and power:
            yield f"<msubsup><mrow>{base}</mrow>{below}{power}</msubsup>"
        elif below or power:
            kind = "sub" if below else "sup"
            yield f"<m{kind}><mrow>{base}</mrow>{below or power}</m{kind}>"
        else:
            yield base


def item(tokens: list[str]) -> str:
    """Return the MathML of the next item, and remove its tokens."""
    if not tokens:
        raise NotationError("the equation ends where an item was expected")
    token = tokens.pop(0)
    if token == "{":
        return group(tokens)
    if token.startswith('"'):
        gap = SPACE if token[1:2].isalpha() else ""
        return f"{gap}<mtext>{escape(token[1:-1]).replace(' ', chr(160))}</mtext>"
    if token[0].isdigit():
        return f"<mn>{token}</mn>"
    if token.isalpha() and token.isascii():
        return word(token, tokens)
    return f"<mo>{escape(token.replace('-', chr(0x2212)))}</mo>"


def word(token: str, tokens: list[str]) -> str:
    """Return the MathML of a name, and remove the tokens of its groups; NotationError for an unknown name."""
    if token == "frac":
        return f"<mfrac>{needed(tokens)}{needed(tokens)}</mfrac>"
    if token == "sqrt":
        return f"<msqrt>{needed(tokens)}</msqrt>"
    if token in SIGNS:
        return f"<mo>&{SIGNS[token]};</mo>"
    if token in FUNCTIONS:
        return f"<mi>{token}</mi>{'' if tokens and tokens[0] == '(' else SPACE}"
    if token in LETTERS:
        return f"<mi>&{token};</mi>"
    if len(token) == 1:
        return f"<mi>{token}</mi>"
    raise NotationError(f"no symbol is called {token!r}; texts stand in quotation marks")


def needed(tokens: list[str]) -> str:
    """Return the MathML of a group that must follow."""
    if not tokens or tokens.pop(0) != "{":
        raise NotationError("frac and sqrt need groups in braces")
    return group(tokens)


def group(tokens: list[str]) -> str:
    """Return the MathML of a group whose opening brace was read."""
    items = list(reading(tokens))
    if not tokens:
        raise NotationError("the equation has a '{' that is not closed")
    tokens.pop(0)
    return f"<mrow>{''.join(items)}</mrow>"
