"""Whole turns, taken out of an angle without losing its last bits."""

from __future__ import annotations


def whole_turns(angle: float) -> float:
    """The number of whole turns nearest to an angle [rad], for less than 2**51 of them; 0 below half a turn."""
    return (angle * 0.15915494309189535 + 6755399441055744.0) - 6755399441055744.0


def without_turns(angle: float, turns: float) -> float:
    """``angle - turns * 2 pi``, with 2 pi in three parts so that the products are exact up to 2**23 turns."""
    return ((angle - turns * 6.283185303211212) - turns * 3.9683743166540886e-09) - turns * 2.068073192717642e-18
