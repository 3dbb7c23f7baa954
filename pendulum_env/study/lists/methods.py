"""List of the integrators as text: order, structure, stability limits, needs, source; and which fit a scene."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import combinations

from integrators import METHODS, Method, MethodError
from integrators.analysis import damping_limit, overdamping_limit, stability_limit
from integrators.method import NEEDS
from integrators.steps.estimates import has_estimates
from integrators.tables.limits import LIMITS
from pendulum_env.engine.machine import offers
from pendulum_env.physics.scene import Scene

SOFT = 0.3
"""Value of omega0 h at which the damping limit of methods with backward sub-steps is computed."""
INDENT = " " * 4
NARROWEST, WIDEST = 60, 120
"""Limits of the width of a text list [characters]."""


@dataclass(frozen=True)
class MethodEntry:
    """Properties of an integrator that lists and tables show.

    Attributes:
        name, source, aliases: name, literature and other names of the method.
        family: family of methods, such as "runge-kutta".
        order: order of the method; "exact" for closed forms.
        structure: words on the method: explicit or implicit, symplectic, symmetric, A-stable, L-stable, adaptive
            (takes rtol), and the method that begins a multistep method's history.
        evaluations: force evaluations per step.
        oscillation_limit: largest stable omega0 h on the undamped oscillator; inf if every step is stable.
        damping_limit: largest stable gamma h under drag alone, or at omega0 h = 0.3 for methods with backward
            sub-steps; inf if every step is stable, None for a method without drag. An unknown limit is None too.
        needs: functions and properties of the forces that the method needs beside the acceleration, keys of
            :data:`integrators.method.NEEDS`.
        what: description of the method in one line.
    """

    name: str
    family: str
    order: str
    structure: str
    evaluations: int
    oscillation_limit: float | None
    damping_limit: float | None
    needs: tuple[str, ...]
    what: str
    source: str
    aliases: tuple[str, ...]

    @property
    def cells(self) -> tuple[str, ...]:
        """Row of the table of integrators: all properties as text, "" for a missing value, limits with all digits."""
        values = (getattr(self, field.name) for field in fields(self))
        return tuple("" if x is None else ", ".join(x) if isinstance(x, tuple) else str(x) for x in values)


COLUMNS = tuple(field.name for field in fields(MethodEntry))
"""Names of the columns of the table of all integrators."""


def shown(limit: float | None) -> str:
    """Return a stability limit as text with four digits: "any" for inf (always stable), "-" for None (unknown)."""
    return "-" if limit is None else "any" if limit == math.inf else f"{limit:.4g}"


@lru_cache(maxsize=512)
def entry(method: Method) -> MethodEntry:
    """Return the properties of an integrator that lists and tables show: order, structure, limits, needs and others."""
    oscillation, damping = limits(method)
    words = {
        "implicit" if method.implicit else "explicit": True,
        "symplectic": method.symplectic,
        "symmetric": method.symmetric,
        "A-stable": method.a_stable and not method.l_stable,
        "L-stable": method.l_stable,
        "adaptive": has_estimates(method),
        f"begun by {method.begun_by.name}" if method.begun_by else "": method.begun_by is not None,
    }
    return MethodEntry(
        name=method.name, family=method.family, order=str(method.order) if math.isfinite(method.order) else "exact",
        structure=", ".join(word for word, holds in words.items() if holds), evaluations=method.evaluations,
        oscillation_limit=oscillation, damping_limit=damping,
        needs=tuple(need for need in NEEDS if need in method.needs and need != "acceleration"),
        what=method.summary, source=method.source, aliases=method.aliases,
    )


def limits(method: Method) -> tuple[float | None, float | None]:
    """Return the largest stable omega0 h and gamma h of a method, for oscillation and for damping.

    The limits of built-in methods are stored in a table; those of other methods are computed.
    """
    stored = LIMITS.get(method.name) if METHODS.get(method.name) is method else None
    return computed_limits(method) if stored is None else stored


def computed_limits(method: Method) -> tuple[float | None, float | None]:
    """Compute the largest stable omega0 h and gamma h of a method, for oscillation and for damping.

    A limit is None if the stability analysis does not apply to the method.
    """
    def known(limit: Callable[..., float], *at: float) -> float | None:
        try:
            return limit(method, *at)
        except MethodError:
            return None

    damping = (overdamping_limit, SOFT) if "reversible" in method.needs else (damping_limit,)
    return known(stability_limit), known(*damping)


def unfit(scene: Scene) -> dict[str, str]:
    """Return a dict of the methods that cannot integrate a scene: name -> reason in words."""
    offered = offers(scene)
    lacking = {name: [need for need in NEEDS if need in method.needs - offered] for name, method in METHODS.items()}
    reason = {need: _refusal(need, scene) for needs in lacking.values() for need in needs}
    return {name: "; and ".join(reason[need] for need in needs) for name, needs in lacking.items() if needs}


def _refusal(need: str, scene: Scene) -> str:
    """Return a requirement of a method that a scene does not meet, in words, with the effects that prevent it.

    If no effect alone prevents it, the effects that do so in pairs are named.
    """
    fixed = scene.of_kind("inertia")

    def refusing(size: int) -> list[str]:
        groups = combinations([effect for effect in scene.effects if effect not in fixed], size)
        places = {group: replace(scene, effects=(*fixed, *group)) for group in groups}
        refusers = {effect for group, place in places.items() if need not in offers(place) for effect in group}
        return [effect.name for effect in scene.effects if effect in refusers]

    alone = refusing(1)
    who = ", ".join(alone) or f"{', '.join(refusing(2)) or 'these effects'} together"
    return f"{NEEDS[need]}, which {who} {'does' if len(alone) == 1 else 'do'} not offer"


def paragraph(text: str, width: int, first: str = INDENT, further: str = INDENT) -> list[str]:
    """Return a text as lines of at most ``width`` characters (60 to 120), indented by ``first`` and ``further``."""
    width = min(max(width, NARROWEST), WIDEST)
    return textwrap.wrap(text, width, initial_indent=first, subsequent_indent=further, break_on_hyphens=False)


def listing(methods: Iterable[Method], width: int = 100) -> str:
    """Return a text list of methods, grouped by family, with a row of numbers and a paragraph on each.

    Lines are at most ``width`` characters long; a very small or large width is replaced by the nearest allowed one.
    """
    groups: dict[str, list[MethodEntry]] = {}
    for one in map(entry, methods):
        free = ", for velocity-free forces" if "velocity_free" in one.needs else ""
        kind = one.structure.split(", ")[0]
        groups.setdefault(f"{one.family[0].upper()}{one.family[1:]}, {kind}{free}", []).append(one)
    blocks = [_block(f"{title} ({len(entries)})", entries, width) for title, entries in groups.items()]
    needed = {need for entries in groups.values() for one in entries for need in one.needs}
    return "\n\n".join([*blocks, *([_legend(needed, width)] if groups else [])])


def _block(title: str, entries: Sequence[MethodEntry], width: int) -> str:
    room = max(len(title), *(len(one.name) for one in entries)) + 2
    head = f"{title:{room}}order  forces  omega0 h  gamma h"
    lines = [head, "-" * len(head)]
    for one in entries:
        limits = f"{shown(one.oscillation_limit):>8}  {shown(one.damping_limit):>7}"
        lines.append(f"{one.name:{room}}{one.order:>5}  {one.evaluations:>6}  {limits}")
        words = ", ".join(one.structure.split(", ")[1:]), f"needs {', '.join(one.needs)}" if one.needs else ""
        parts = ["; ".join(filter(None, words)), one.what, one.source,
                 f"Also {', '.join(one.aliases)}" if one.aliases else ""]
        lines += paragraph(" ".join(f"{part[0].upper()}{part[1:]}." for part in parts if part), width)
    return "\n".join(lines)


def _legend(needed: Iterable[str], width: int) -> str:
    notes: Mapping[str, str] = {
        "forces": "force evaluations per step; of implicit methods per Newton iteration",
        "omega0 h": "largest stable step h on an undamped oscillation of frequency omega0; 0: always unstable; any: "
                    "unconditionally stable",
        "gamma h": "largest stable step h under drag of rate gamma alone, or, for methods that need \"reversible\", "
                   f"at omega0 h = {SOFT:g}; -: not for drag",
        "adaptive": "estimates its error and so can adapt its step to rtol and atol",
        **{need: NEEDS[need] for need in NEEDS if need in needed},
    }
    return "\n".join(line for name, text in notes.items() for line in paragraph(f"{name}: {text}.", width, ""))


def fit_listing(scene: Scene, width: int = 100, whole: bool = True) -> str:
    """Return a text list of the methods that fit a scene, then of those that do not, with the reasons.

    Without ``whole`` it is only the names of those that fit.
    """
    refused = unfit(scene)
    fit = [name for name in METHODS if name not in refused]
    title = (f"{len(fit)} of {len(METHODS)} integrators fit the scene {scene.name}, "
             f"{', '.join(effect.name for effect in scene.effects) or 'without effects'}.")
    if not whole:
        return "\n".join([title, *paragraph(", ".join(fit), width, "", ""),
                          "--all describes them, and says why others do not fit."])
    lines = [title, "", listing((METHODS[name] for name in fit), width)]
    for why in dict.fromkeys(refused.values()):
        names = [name for name in refused if refused[name] == why]
        lines += ["", *paragraph(f"{len(names)} methods do not fit: they need {why}.", width, "", "")]
        lines += paragraph(", ".join(names), width)
    return "\n".join(lines)
