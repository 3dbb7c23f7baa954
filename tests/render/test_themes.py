"""Light and dark themes: everything with a meaning has enough contrast, and its hue is the same in both."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pendulum_env.render import METHOD_COLOURS, PANELS, THEMES, Apparatus, FrameStyle, Theme, View, frame, side_by_side
from pendulum_env.render.palette import ENERGY_COLOURS, OKABE_ITO, rgb

WIRE = Apparatus(length=0.353, bob_radius=0.0107, suspension="wire", rod_radius=0.0002, title="exercise")
VIEW = View(1.0, 0.5, 0.3, 0.6, 0.02, 0.01, 0.005, None, 0.002, (0.1, 0.3), "rk4", 0.05)


def luminance(hexadecimal: str) -> float:
    """Return the relative luminance of a hex colour, as WCAG 2.2 (W3C 2023) defines it."""
    share = rgb(hexadecimal).astype(float) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(first: str, second: str) -> float:
    """Return the contrast ratio of two hex colours, 1 to 21, as WCAG 2.2 (W3C 2023) defines it."""
    low, high = sorted((luminance(first), luminance(second)))
    return (high + 0.05) / (low + 0.05)


def test_contrast_is_that_of_the_standard() -> None:
    assert contrast("#000000", "#FFFFFF") == pytest.approx(21.0)
    assert contrast("#767676", "#FFFFFF") == pytest.approx(4.54, abs=0.005)  # the standard's own example of a limit


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_text_can_be_read(theme: Theme) -> None:
    for ink, paper in ((theme.ink, theme.paper), (theme.faint_ink, theme.paper), (theme.ink, theme.dial)):
        assert contrast(ink, paper) >= 4.5
    assert contrast(theme.warning, theme.paper) >= 3.0  # large and bold, and said in words


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_lines_that_mean_something_can_be_seen(theme: Theme) -> None:
    for line in (theme.rule, theme.ink, theme.bob):
        assert contrast(line, theme.track) >= 3.0
        assert contrast(line, theme.paper) >= 3.0
    for line in (theme.wire, theme.ink, theme.faint_ink, theme.torque, theme.bob):
        assert contrast(line, theme.dial) >= 3.0
    assert contrast(theme.wire, theme.paper) >= 3.0


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
@pytest.mark.parametrize("name", ENERGY_COLOURS)
def test_curves_of_energies_or_their_rims_can_be_seen(theme: Theme, name: str) -> None:
    assert max(contrast(tone, theme.track) for tone in (ENERGY_COLOURS[name], theme.casing)) >= 3.0


def test_hues_of_energies_and_methods_are_those_of_the_figures() -> None:
    assert set(ENERGY_COLOURS.values()) | set(METHOD_COLOURS) <= set(OKABE_ITO.values())
    dark = THEMES["dark"]
    assert [dark.accent(tone) for tone in METHOD_COLOURS if tone != "#000000"] == [
        tone for tone in METHOD_COLOURS if tone != "#000000"]
    assert contrast(dark.accent("#000000"), dark.paper) >= 4.5
    assert THEMES["light"].accent("#000000") == "#000000"


def test_every_colour_is_one() -> None:
    for theme in THEMES.values():
        for field in dataclasses.fields(theme):
            if field.name not in ("name", "swaps"):
                rgb(getattr(theme, field.name))


@pytest.mark.parametrize("panels", [("apparatus", "energy"), tuple(PANELS)])
def test_a_themes_paper_is_all_around(panels: tuple[str, ...]) -> None:
    for theme in THEMES.values():
        image = frame(WIRE, VIEW, 400, FrameStyle(theme.name, panels))
        rim = np.concatenate((image[0], image[-1], image[:, 0], image[:, -1]))
        plain = (rim == rgb(theme.paper)).all(axis=1)
        assert plain.mean() > 0.95
        sheet = side_by_side([(WIRE, VIEW)] * 3, 200, look=FrameStyle(theme.name, panels))
        assert (sheet[0] == rgb(theme.paper)).all()
        assert (sheet[-1, -1] == rgb(theme.paper)).all()


def test_dark_and_light_show_the_same_shapes() -> None:
    """The pixels that differ between two views are the same in the dark and the light theme."""
    one, other = View(0.0, 0.4), View(0.0, -0.9)
    changed = [(frame(WIRE, one, 300, FrameStyle(theme)) != frame(WIRE, other, 300, FrameStyle(theme))).any(axis=2)
               for theme in THEMES]
    assert (changed[0] ^ changed[1]).sum() < 0.06 * changed[0].sum()
