"""What all tests share: seeds, skips, and programs compiled once for all processes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of real recordings, which are no part of the package."""
    folder = os.environ.get("LAB_PENDULUM_DATA")
    if not folder:
        pytest.skip("LAB_PENDULUM_DATA does not name a folder of recordings")
    return Path(folder)
