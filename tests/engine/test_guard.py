"""Tests for the digests of every method in every scene, in each way to run (``tests/support/guard.py``)."""

from __future__ import annotations

import guard
import in_node
import pytest

KEPT = guard.stored()


@pytest.mark.slow
@pytest.mark.parametrize("group", guard.EVERY)
def test_no_bit_differs(group: str) -> None:
    if group == "javascript" and not in_node.NODE:
        pytest.skip("Node is missing")
    here = guard.found(group)
    assert here.keys() == KEPT[group].keys()
    assert not [sample for sample, digest in here.items() if digest != KEPT[group][sample]]
