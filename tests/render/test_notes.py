"""Tests of a window's division into frames, readings and a status line."""

from __future__ import annotations

import pytest

from pendulum_env.render.notes import Sheet
from pendulum_env.render.text import measure


@pytest.mark.parametrize("readings", [1, 2, 3])
@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("size", [(500, 500), (1920, 1080), (1000, 300)])
def test_readings_have_room_for_their_letters_below_the_frame(size: tuple[int, int], count: int, readings: int) -> None:
    sheet = Sheet(*size, count, readings)
    assert sheet.readings_height >= sheet.reading_rows * measure("0.123 rad/s", sheet.reading_font)[1]
    assert sheet.frame[1] + sheet.readings_height <= sheet.panel[1]


def test_without_readings_the_frame_has_the_whole_panel() -> None:
    sheet = Sheet(600, 500, 2)
    assert (sheet.readings_height, sheet.frame) == (0, sheet.panel)
