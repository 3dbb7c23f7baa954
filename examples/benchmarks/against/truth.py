"""Reference solution of the benchmark: the closed form without damping, Taylor series in extended precision with it.

Both are checked by Taylor series of another order with other steps. All trajectories advance together in numpy's
longdouble,
whose 64-bit mantissa on x86 reduces rounding 2000 times compared with doubles. The series are independent of
the package's own Taylor series.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from against.problem import RATE, Array, Problem

SERIES, CHECK = (24, 10.0), (28, 12.0)
"""Order and steps per second of the reference solution and of its check; the first omitted term is below 1e-19."""


def taylor(starts: Any, gamma: float, times: Any, order: int, rate: float) -> Any:
    """Return angles ``(len(starts), len(times))`` in longdouble, by Taylor series, ``rate`` or more steps per second.

    ``s_k = sum_j j q_j c_(k-j)/k`` and ``c_k = -sum_j j q_j s_(k-j)/k`` for sine and cosine of
    ``q = sum_k q_k h**k``; ``v_(k+1) = -(RATE s_k + gamma v_k)/(k + 1)``, ``q_(k+1) = v_k/(k + 1)``.
    """
    exact = np.longdouble
    size = len(starts)
    q, v, sine, cosine, fed = (np.zeros((size, order + 1), dtype=exact) for _ in range(5))
    q[:, 0], w2, g = starts, exact(RATE), exact(gamma)
    marks = np.asarray(times, dtype=exact)
    angles = np.empty((size, len(marks)), dtype=exact)
    angles[:, 0] = q[:, 0]
    for i in range(1, len(marks)):
        gap = marks[i] - marks[i - 1]
        steps = max(1, int(np.ceil(float(gap) * rate)))
        h = gap / steps
        for _ in range(steps):
            sine[:, 0], cosine[:, 0] = np.sin(q[:, 0]), np.cos(q[:, 0])
            for k in range(order):
                if k:
                    fed[:, k] = k * q[:, k]
                    sine[:, k] = _sum(fed[:, 1 : k + 1], cosine[:, k - 1 :: -1]) / k
                    cosine[:, k] = -_sum(fed[:, 1 : k + 1], sine[:, k - 1 :: -1]) / k
                v[:, k + 1] = -(w2 * sine[:, k] + g * v[:, k]) / (k + 1)
                q[:, k + 1] = v[:, k] / (k + 1)
            for y in (q, v):
                total = y[:, order]
                for k in range(order - 1, -1, -1):
                    total = total * h + y[:, k]
                y[:, 0] = total
        angles[:, i] = q[:, 0]
    return angles


def _sum(one: Any, other: Any) -> Any:
    return np.einsum("ij,ij->i", one, other)


def truth(problem: Problem, folder: Path) -> tuple[Path, float]:
    """Return the file of the reference angles, and the largest difference to their check at every 64th start [rad]."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"truth-{problem.scene}-{problem.duration:g}s-{problem.size}.npy"
    noted = file.with_suffix(".txt")
    if not noted.exists():
        starts, gamma, times = problem.starts, problem.gamma, problem.times
        angles = taylor(starts, gamma, times, *SERIES).astype(np.float64) if gamma else closed_form(starts, times)
        check = taylor(starts[::64], gamma, times, *CHECK).astype(np.float64)
        with file.open("wb") as opened:
            np.save(opened, angles)
        noted.write_text(repr(float(np.max(np.abs(check - angles[::64])))))
    return file, float(noted.read_text())


def closed_form(starts: Array, times: Array) -> Array:
    """Return the angles of the undamped pendulum in closed form, ``(len(starts), len(times))``."""
    from pendulum_env.physics import exact

    return np.array([exact.pendulum(times, float(start), 0.0, RATE**0.5)[0] for start in starts])
