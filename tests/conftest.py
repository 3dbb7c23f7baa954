"""What all tests share: seeds, skips, and programs compiled once for all processes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

import integrators


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of real recordings, which are no part of the package."""
    folder = os.environ.get("LAB_PENDULUM_DATA")
    if not folder:
        pytest.skip("LAB_PENDULUM_DATA does not name a folder of recordings")
    return Path(folder)


EVERYWHERE = (
    "forward_euler", "backward_euler", "symplectic_euler", "symplectic_euler_position_first", "velocity_verlet",
    "conformal_symplectic_euler", "midpoint", "heun", "rk4", "implicit_midpoint", "dopri5", "gauss4",
    "discrete_gradient", "forest_ruth", "blanes_moan_srkn11b", "exact",
)
"""Methods that quick tests run in scenes: the plain ones and one of every further family. Slow tests run them all; what
needs no scene, the contract of a method, is quick for each."""

IN_SCENES = ("batch_rollout", "compare", "cost", "engine", "env", "hard_cases", "ledger", "vector_env")
"""Tests that compile, or run, a method in many scenes."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[Any]) -> None:
    for item in items:
        named = named_methods(item.callspec.params) if hasattr(item, "callspec") else set()
        if item.path.stem.removeprefix("test_") in IN_SCENES and not named <= set(EVERYWHERE):
            item.add_marker(pytest.mark.slow)


def named_methods(params: Any) -> set[str]:
    """Names of methods among a test's parameters, in tuples too."""
    if isinstance(params, dict):
        return set().union(*(named_methods(value) for value in params.values()))
    if isinstance(params, tuple):
        return set().union(*(named_methods(value) for value in params))
    if isinstance(params, integrators.Method):
        return {params.name}
    return {params} if isinstance(params, str) and params in integrators.METHODS else set()
