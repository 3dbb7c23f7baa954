"""What lists say of every integrator: order, structure, limits, needs, source; and which fit a scene."""

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
"""omega0 h at which the damping limit of methods with backward sub-steps is given."""
INDENT = " " * 4
NARROWEST, WIDEST = 60, 120


@dataclass(frozen=True)
class Entry:
    """One method as lists show it.

    Attributes:
        name, order, source, aliases: as the method declares them.
        family: as the method's class names it.
        order: "exact" for closed forms.
        structure: explicit or implicit; symplectic, symmetric, A- or L-stable, adaptive (takes rtol) where it is so;
            of a multistep method what begins it.
        evaluations: force evaluations per step.
        oscillation_limit: largest omega0 h without growth on the undamped oscillator; inf if none.
        damping_limit: largest gamma h without growth under drag alone, or at omega0 h = SOFT for methods with backward
            sub-steps; inf if none, None for a method that takes no drag. Both limits are None where they are not known.
        needs: keys of :data:`integrators.method.NEEDS` beside the acceleration.
        what: one line.
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
        """All of it as text, "" for what is not there, limits in full, "inf" for none."""
        values = (getattr(self, field.name) for field in fields(self))
        return tuple("" if x is None else ", ".join(x) if isinstance(x, tuple) else str(x) for x in values)


COLUMNS = tuple(field.name for field in fields(Entry))


def shown(limit: float | None) -> str:
    """A limit to four digits: "any" for inf, "-" for None."""
    return "-" if limit is None else "any" if limit == math.inf else f"{limit:.4g}"


@lru_cache(maxsize=512)
def entry(method: Method) -> Entry:
    """What there is to say of a method."""
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
    return Entry(
        name=method.name, family=method.family, order=str(method.order) if math.isfinite(method.order) else "exact",
        structure=", ".join(word for word, holds in words.items() if holds), evaluations=method.evaluations,
        oscillation_limit=oscillation, damping_limit=damping,
        needs=tuple(need for need in NEEDS if need in method.needs and need != "acceleration"),
        what=method.summary, source=method.source, aliases=method.aliases,
    )


def limits(method: Method) -> tuple[float | None, float | None]:
    """Return both limits of an :class:`Entry`: those stored for a method of the registry, else computed now."""
    stored = LIMITS.get(method.name) if METHODS.get(method.name) is method else None
    return computed_limits(method) if stored is None else stored


def computed_limits(method: Method) -> tuple[float | None, float | None]:
    """Compute both limits of an :class:`Entry`; None where :mod:`integrators.analysis` does not take the method."""
    return _known(lambda: stability_limit(method)), _known(lambda: _damping(method))


def _damping(method: Method) -> float:
    return overdamping_limit(method, SOFT) if "reversible" in method.needs else damping_limit(method)


def _known(limit: Callable[[], float]) -> float | None:
    """A limit; None where the analysis does not take the method."""
    try:
        return limit()
    except MethodError:
        return None


def unfit(scene: Scene) -> dict[str, str]:
    """The methods that do not fit a scene, and what they need, in words, that which effects do not offer."""
    offered = offers(scene)
    lacking = {name: [need for need in NEEDS if need in method.needs - offered] for name, method in METHODS.items()}
    said = {need: _refusal(need, scene) for needs in lacking.values() for need in needs}
    return {name: "; and ".join(said[need] for need in needs) for name, needs in lacking.items() if needs}


def _refusal(need: str, scene: Scene) -> str:
    """A need in words, with the effects that each alone do not allow it, or those that only in pairs do not."""
    fixed = scene.of_kind("inertia")

    def refusing(size: int) -> list[str]:
        groups = combinations([effect for effect in scene.effects if effect not in fixed], size)
        places = {group: replace(scene, effects=(*fixed, *group)) for group in groups}
        found = {effect for group, place in places.items() if need not in offers(place) for effect in group}
        return [effect.name for effect in scene.effects if effect in found]

    alone = refusing(1)
    who = ", ".join(alone) or f"{', '.join(refusing(2)) or 'these effects'} together"
    return f"{NEEDS[need]}, which {who} {'does' if len(alone) == 1 else 'do'} not offer"


def listing(methods: Iterable[Method], width: int = 100) -> str:
    """The methods by families: a row of numbers each, and a paragraph below it; at most ``width`` characters wide."""
    width = min(max(width, NARROWEST), WIDEST)
    groups: dict[str, list[Entry]] = {}
    for method in methods:
        found = entry(method)
        kind = found.structure.split(", ")[0]
        free = ", for velocity-free forces" if "velocity_free" in found.needs else ""
        groups.setdefault(f"{found.family[0].upper()}{found.family[1:]}, {kind}{free}", []).append(found)
    blocks = [_block(f"{title} ({len(entries)})", entries, width) for title, entries in groups.items()]
    needed = {need for entries in groups.values() for found in entries for need in found.needs}
    return "\n\n".join([*blocks, *([_legend(needed, width)] if groups else [])])


def _block(title: str, entries: Sequence[Entry], width: int) -> str:
    room = max(len(title), *(len(found.name) for found in entries)) + 2
    lines = [f"{title:{room}}order  forces  omega0 h  gamma h"]
    lines.append("-" * len(lines[0]))
    for found in entries:
        limits = f"{shown(found.oscillation_limit):>8}  {shown(found.damping_limit):>7}"
        lines.append(f"{found.name:{room}}{found.order:>5}  {found.evaluations:>6}  {limits}")
        words = found.structure.split(", ")[1:]
        head = "; ".join([*([", ".join(words)] if words else []),
                          *([f"needs {', '.join(found.needs)}"] if found.needs else [])])
        parts = [head, found.what, found.source, f"Also {', '.join(found.aliases)}" if found.aliases else ""]
        text = " ".join(f"{part[0].upper()}{part[1:]}." for part in parts if part)
        lines += textwrap.wrap(text, width, initial_indent=INDENT, subsequent_indent=INDENT, break_on_hyphens=False)
    return "\n".join(lines)


def _legend(needed: Iterable[str], width: int) -> str:
    notes: Mapping[str, str] = {
        "forces": "evaluations per step; of implicit methods per sweep of Newton's method",
        "omega0 h": "up to here undamped oscillations do not grow; 0 if they grow at any step, \"any\" if at none",
        "gamma h": "up to here speed does not grow under drag alone, or, in methods that need \"reversible\", at "
                   f"omega0 h = {SOFT:g}; - if a method takes no drag",
        "adaptive": "estimates its error, and takes rtol and atol",
        **{need: NEEDS[need] for need in NEEDS if need in needed},
    }
    lines = []
    for name, text in notes.items():
        lines += textwrap.wrap(f"{name}: {text}.", width, subsequent_indent=INDENT, break_on_hyphens=False)
    return "\n".join(lines)


def fit_listing(scene: Scene, width: int = 100) -> str:
    """Which methods fit a scene, as :func:`listing`, then which do not, and why."""
    width = min(max(width, NARROWEST), WIDEST)
    refused = unfit(scene)
    reasons: dict[str, list[str]] = {}
    for name, why in refused.items():
        reasons.setdefault(why, []).append(name)
    lines = [f"{len(METHODS) - len(refused)} of {len(METHODS)} integrators fit the scene {scene.name}, "
             f"{', '.join(effect.name for effect in scene.effects) or 'without effects'}.", ""]
    lines.append(listing((method for name, method in METHODS.items() if name not in refused), width))
    for why, names in reasons.items():
        lines += ["", *textwrap.wrap(f"These {len(names)} do not fit: they need {why}.", width,
                                           break_on_hyphens=False)]
        lines += textwrap.wrap(", ".join(names), width, initial_indent=INDENT, subsequent_indent=INDENT)
    return "\n".join(lines)
