"""How frames look: theme and panels, by name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

from pendulum_env.render.stage import DEFAULT, PANELS
from pendulum_env.render.theme import THEMES


@dataclass(frozen=True)
class Look:
    """How frames look.

    Attributes:
        theme: name of one of THEMES.
        panels: names from PANELS, each at most once; the apparatus takes the main place, the others follow in their
            order.

    Raises ValueError for another name, the same panel twice, or no panel.
    """

    theme: str = "light"
    panels: tuple[str, ...] = DEFAULT

    def __post_init__(self) -> None:
        _known("theme", self.theme, THEMES)
        if isinstance(self.panels, str) or not isinstance(self.panels, Iterable):
            raise ValueError(f"panels must be several of {', '.join(PANELS)}, not {self.panels!r}")
        object.__setattr__(self, "panels", tuple(self.panels))
        for name in self.panels:
            _known("panel", name, PANELS)
        if not self.panels or len(set(self.panels)) < len(self.panels):
            what = "none" if not self.panels else "one of them twice"
            raise ValueError(f"panels must be one or more of {', '.join(PANELS)}, not {what}")

    @property
    def needs(self) -> frozenset[str]:
        """What its panels show beside angle and velocity; see :class:`pendulum_env.render.stage.Panel`."""
        return frozenset().union(*(PANELS[name].needs for name in self.panels))


def _known(kind: str, name: object, names: Iterable[str]) -> None:
    known = list(names)
    if not isinstance(name, str) or name not in known:
        near = difflib.get_close_matches(str(name)[:80], known, n=1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"a {kind} must be one of {', '.join(known)}, not {str(name)[:80]!r}{meant}")
