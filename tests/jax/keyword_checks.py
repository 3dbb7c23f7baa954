"""Every keyword of the twin's functions, spoilt in every way: one clear error each. Run by test_twin.py."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

import jax
import pytest
from keyword_kinds import KIND_OF, KINDS, VALUES, check_refusal, outcome
from keyword_table import keywords

import pendulum_env.jax as twin

jax.config.update("jax_enable_x64", True)
FUNCTIONS = {"rollout": twin.rollout, "LabPendulum": twin.LabPendulum}
WORKING: Mapping[str, Mapping[str, Any]] = {
    "rollout": {"scene": "vacuum", "steps": 2, "dt": 0.01}, "LabPendulum": {"scene": "vacuum", "task": "free"},
}
"""Keywords of calls that work."""
BESIDE_IT: Mapping[str, Mapping[str, Any]] = {
    "smooth": {"scene": "sticky_bearing"}, "duration": {"steps": None}, "actions": {"scene": "lab", "steps": None},
}
OWN = {
    "rollout.angle": "numbers", "rollout.velocity": "numbers", "rollout.speed_limit": "limit", "smooth": "positive",
    "dtype": "word", "rollout.actions": "numbers", "rollout.duration": "positive", "max_steps": "count",
    "rollout.control": "share", "rollout.seed": "seed", "LabPendulum.speed_limit": "limit",
}
"""Kinds of the twin's own keywords, and of those that take something else there."""
PAIRS = [(label, one.name) for label, function in FUNCTIONS.items() for one in keywords(function)]


@pytest.mark.parametrize(("label", "name"), PAIRS, ids=str)
def test_what_cannot_be_is_refused_in_one_sentence(label: str, name: str) -> None:
    function = FUNCTIONS[label]
    default = inspect.signature(function).parameters[name].default
    fine, either = KINDS[OWN.get(f"{label}.{name}") or OWN.get(name) or KIND_OF[name]]
    usual = {**WORKING[label], **BESIDE_IT.get(name, {})}
    for word, value in VALUES.items():
        if word in fine or (value is None and default is None):
            continue
        error = outcome(lambda value=value: function(**{**usual, name: value}))  # type: ignore[misc]
        if error is not None or word not in either:
            try:
                check_refusal(error)
            except AssertionError as reason:
                raise AssertionError(f"{name}={word}: {reason}") from error


@pytest.mark.parametrize("label", FUNCTIONS)
def test_unknown_keywords_are_named(label: str) -> None:
    check_refusal(outcome(lambda: FUNCTIONS[label](**WORKING[label], lenght=1.0)), "lenght", "did you mean length")
