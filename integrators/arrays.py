"""Implicit stages on arrays: Newton's method with the full matrix of derivatives, by differences.

Scalars go through the unrolled source; this is the one path where the components of ``q`` may be coupled.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.method import RungeKutta, System

Array = NDArray[np.float64]
SWEEPS = 50


def implicit_step(method: RungeKutta, system: System) -> Callable[..., tuple[Any, ...]]:
    """``step(t, q, v, h)`` of a diagonally implicit method on arrays of any shape.

    A stage that Newton's method cannot solve yields nan, which :func:`integrators.solve` reports.
    """
    table = [[float(value) for value in row] for row in method.a]
    weights = [float(value) for value in method.b]
    nodes = [float(value) for value in method.c]

    def step(t: float, q: Array, v: Array, h: float) -> tuple[Array, Array]:
        slopes: list[Array] = []
        speeds: list[Array] = []
        for i, row in enumerate(table):
            base_v = v + h * sum((row[j] * slopes[j] for j in range(i)), np.zeros_like(v))
            base_q = q + h * sum((row[j] * speeds[j] for j in range(i)), np.zeros_like(q))
            d, when = h * row[i], t + nodes[i] * h
            k = _solve(partial(system.acceleration, when), base_q, base_v, d)
            slopes.append(k)
            speeds.append(base_v + d * k)
        q1 = q + h * sum((b * speed for b, speed in zip(weights, speeds, strict=True)), np.zeros_like(q))
        v1 = v + h * sum((b * slope for b, slope in zip(weights, slopes, strict=True)), np.zeros_like(v))
        return q1, v1

    return step


def _solve(acceleration: Callable[[Array, Array], Array], q: Array, v: Array, d: float) -> Array:
    """``k = a(q + d w, w)`` with ``w = v + d k``; full-step Newton until its steps no longer shrink."""

    def residual(k: Array) -> Array:
        w = v + d * k
        return np.asarray(k - acceleration(q + d * w, w), dtype=float)

    k: Array = np.zeros(np.shape(v))
    last = np.inf
    for _ in range(SWEEPS):
        r = residual(k)
        if not np.all(np.isfinite(r)):
            break
        matrix = np.empty((k.size, k.size))
        for j in range(k.size):
            shift = np.zeros(k.size)
            shift[j] = 1e-6 * (1.0 + abs(k.flat[j]))
            bump = shift.reshape(k.shape)
            matrix[:, j] = (residual(k + bump) - residual(k - bump)).ravel() / (2.0 * shift[j])
        try:
            change = np.linalg.solve(matrix, r.ravel()).reshape(k.shape)
        except np.linalg.LinAlgError:
            break
        k = k - change
        size = float(np.max(np.abs(change)))
        if size == 0.0 or (size <= 1e-6 * float(np.max(np.abs(k))) and 2.0 * size >= last):
            return k
        last = size
    unsolved: Array = np.full(k.shape, np.nan)
    return unsolved
