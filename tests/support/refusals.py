"""How bad input is refused."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from pendulum_env import SceneError


def check_refused(make: Callable[[], object], words: str) -> None:
    """AssertionError unless it raises SceneError with these words, in one sentence."""
    with pytest.raises(SceneError) as error:
        make()
    assert words in str(error.value)
    assert "\n" not in str(error.value)
