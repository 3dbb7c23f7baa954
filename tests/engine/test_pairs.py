"""Sums of sines and cosines side by side in runs of one pendulum: which are, which must not be, and the same bits."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, rollout
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import PREAMBLE
from pendulum_env.engine.pairs import LEAST, NAME, paired
from pendulum_env.engine.source import TEXT

FACTORS = [f"v{i}" for i in range(LEAST)]
ARGUMENTS = ", ".join([*FACTORS, *(f"{name}{i}" for name in "cs" for i in range(LEAST))])


def total(name: str, factors: list[str] = FACTORS) -> str:
    return " + ".join(f"{x}*{name}{i}" for i, x in enumerate(factors))


def series(*lines: str) -> str:
    return "\n    ".join([f"def series({ARGUMENTS}):", *lines]) + "\n"


ONE, OTHER = f"a = 0.3*({total('c')})", f"b = -0.3*({total('s')})"
PAIRED = {
    "two sums": series(ONE, OTHER, "return a, b"),
    "a line between": series(ONE, "d = 2.0*a", OTHER, "return a, b, d"),
    "other scales": series(ONE, OTHER.replace("-0.3", "7.0"), "return a, b"),
    "a short pair beside a long one": series("e = 0.5*(v0*c0 + v1*c1)", "f = 2.5*(v0*s0 + v1*s1)", ONE, OTHER,
                                             "return a, b, e, f"),
    "the second takes what is known before the first": series("w = v0*c1", ONE, OTHER.replace("s3", "w"),
                                                               "return a, b"),
}
ALONE = {
    "the second takes the first": series(ONE, OTHER.replace("s3", "a"), "return a, b"),
    "the second takes what comes between": series(ONE, "s3 = 2.0*a", OTHER, "return a, b, s3"),
    "other factors": series(ONE, f"b = -0.3*({total('s', FACTORS[::-1])})", "return a, b"),
    "a difference": series(ONE, OTHER.replace("+ v3", "- v3"), "return a, b"),
    "no scale": series(f"a = {total('c')}", f"b = {total('s')}", "return a, b"),
    "a scale that is no number": series(ONE.replace("0.3", "v0"), OTHER.replace("-0.3", "v0"), "return a, b"),
    "a product of three": series(ONE, OTHER.replace("v3*", "v3*v2*"), "return a, b"),
    "all sums are short": series(*(f"{name} = 0.5*({total(y, FACTORS[1:])})" for name, y in (("a", "c"), ("b", "s"))),
                                 "return a, b"),
    "only one": series(ONE, "b = a", "return a, b"),
    "a factor changes between": series(ONE, "v3 = 2.0*v3", OTHER, "return a, b"),
    "a result is set before": series(ONE, "b = 7.0", "d = 2.0*b", OTHER, "return a, b, d"),
    "a function beside the series": series(ONE, OTHER, "return a, b").replace("def series", "def other")
    + series("return other(" + ARGUMENTS + ")"),
    "no series": series(ONE, OTHER, "return a").replace("def series", "def other"),
}


def calls(text: str) -> int:
    return text.count(f"{NAME}(")


def plainly(scales: Any, factors: Any, first: Any, second: Any) -> tuple[float, float]:
    """Return both sums, by loops."""
    found = []
    for scale, others in zip(scales, (first, second), strict=True):
        added = factors[0] * others[0]
        for x, y in zip(factors[1:], others[1:], strict=True):
            added += x * y
        found.append(scale * added)
    return found[0], found[1]


def value(text: str, numbers: list[float]) -> list[str]:
    names: dict[str, Any] = {NAME: plainly}
    exec(text, names)
    function = names.get("series") or names["other"]
    return [x.hex() for x in np.atleast_1d(function(*numbers)).tolist()]


@pytest.mark.parametrize(("text", "expected"), [
    *(pytest.param(text, text.count("= 0.3*(") + text.count("= 0.5*("), id=name) for name, text in PAIRED.items()),
    *(pytest.param(text, 0, id=name) for name, text in ALONE.items()),
])
def test_which_sums_are_paired(text: str, expected: int) -> None:
    found = paired(text)
    assert calls(found) == expected
    numbers = np.random.default_rng(1).normal(size=3 * LEAST).tolist()
    assert value(found, numbers) == value(text, numbers)


@pytest.mark.parametrize(("name", "expected"), [("taylor13", 0), ("taylor14", 12), ("quick_taylor20", 18), ("rk4", 0)])
def test_every_order_of_a_long_series_is_paired(name: str, expected: int) -> None:
    """Orders 2 to p - 1 of sine and cosine; order 1 has one product each."""
    text = program(SCENES["lab"], integrators.get(name), ()).text
    found = paired(text)
    assert calls(found) == expected


OPTIONS: dict[str, dict[str, Any]] = {
    "vacuum": {"rtol": 1e-9, "even_steps": True}, "lab": {"diagnostics": ("heat_by_effect", "energy")},
    "kapitza": {"compensated": True}, "chaotic": {"rtol": 1e-9}, "sticky_bearing": {},
}
"""Scenes, several of which take more than one sine, and what their runs ask for."""


@pytest.mark.parametrize("scene", OPTIONS)
@pytest.mark.parametrize("name", ["taylor14", "quick_taylor17"])
def test_compiled_runs_have_the_bits_of_interpreted_ones(scene: str, name: str) -> None:
    asked: dict[str, Any] = {"integrator": name, "angle": 2.0, "velocity": 0.3, "duration": 0.5, "dt": 0.02}
    one, other = (rollout(scene, **asked, **OPTIONS[scene], backend=backend) for backend in ("python", "compiled"))
    for quantity in ("angle", "velocity", "energy_residual"):
        assert getattr(one, quantity).tobytes() == getattr(other, quantity).tobytes(), quantity


def test_a_batch_has_the_bits_of_single_runs() -> None:
    """Its program has no pairs: instructions there work on several pendulums."""
    asked: dict[str, Any] = {"integrator": "quick_taylor16", "duration": 2.0, "dt": 0.1}
    angles = np.linspace(1.0, 3.0, 5)
    batch = rollout("lab", angle=angles, **asked)
    for angle, row in zip(angles, batch.angle, strict=True):
        assert rollout("lab", angle=float(angle), **asked).angle.tobytes() == row.tobytes()


def test_the_machine_code_of_a_run_multiplies_pairs() -> None:
    """Not only the text: a run of order 14 has as many packed products more as its sums have terms."""
    numbers, number, whole = numba.types.Array(numba.float64, 1, "C"), numba.float64, numba.int64
    packed = {}
    for order in (13, 14):
        text = PREAMBLE + program(SCENES["vacuum"], integrators.get(f"taylor{order}"), ()).text
        space: dict[str, Any] = {"__name__": "paired"}
        exec(text, space)
        space[TEXT] = text
        space["run"].compile((numbers, numbers, number, number, whole, whole, number,
                              numba.types.Array(number, 2, "C"), numba.types.Array(numba.float32, 1, "C")))
        packed[order] = "\n".join(space["run"].inspect_llvm().values()).count("fmul <2 x double>")
    assert packed[14] >= packed[13] + sum(range(2, 14)) - 2, packed  # numba 0.60 packs two fewer
