"""Steps that are written out for each component of a short array have the bits of those on whole arrays."""

from __future__ import annotations

import ast
from typing import Any

import numpy as np
import pytest

from integrators import METHODS, MethodError, solve, solve_first_order, unroll
from integrators.solving import stepper

TABLES = [name for name, method in METHODS.items()
          if (method.tableau or method.nystrom_tableau) and not method.implicit and "jacobian" not in method.needs]


@pytest.fixture
def whole(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A function that runs another one with steps on whole arrays."""
    def run(function: Any) -> Any:
        with monkeypatch.context() as patch:
            patch.setattr(stepper, "FEW", 0)
            return function()

    return run


def pulled(t: float, q: Any, v: Any) -> Any:
    return -np.sin(q) * q.ravel()[0] - np.flip(q) / 3.0 + 0.1 * t


@pytest.mark.parametrize("shape", [(1,), (2,), (2, 3)])
@pytest.mark.parametrize("name", TABLES)
def test_bits_are_those_of_whole_arrays(name: str, shape: tuple[int, ...], whole: Any) -> None:
    q, v = np.random.default_rng(3).normal(size=(2, *shape))
    modes: list[dict[str, Any]] = [{"h": 0.1}, {"h": 0.1, "dense": True}]
    modes += [{"rtol": 1e-6, "dense": True}] if METHODS[name].embedded_orders else []
    for options in modes:
        few, other = (run(lambda options=options: solve(pulled, q, v, [0.0, 1.0], method=name, **options))
                      for run in (lambda function: function(), whole))
        assert (few.q.tobytes(), few.v.tobytes(), few.evaluations) == (
            other.q.tobytes(), other.v.tobytes(), other.evaluations)
        if "dense" in options:
            assert np.array_equal(few([0.31, 0.77]), other([0.31, 0.77]))


def test_compensated_and_first_order_steps_too(whole: Any) -> None:
    for function in (lambda: solve(pulled, [0.3, 0.4], [1.0, 0.0], [0.0, 1.0], method="rk4", h=0.01,
                                   compensated=True).q,
                     lambda: solve_first_order(lambda t, y: np.array([y[1], -np.sin(y[0])]), [0.0, 5.0], [2.0, 0.1],
                                               method="dop853", rtol=1e-9).y):
        assert function().tobytes() == whole(function).tobytes()


def test_what_is_written_out_and_what_is_not() -> None:
    """Straight-line steps are; others run as they are."""
    source = unroll(METHODS["rk4"])
    tree = stepper.written_out(source, 2)
    assert tree is not None
    assert {"q_0", "q_1", "a4_1", "parts", "joined"} <= {one.id for one in ast.walk(tree) if isinstance(one, ast.Name)}
    assert stepper.written_out("def step(t, q, v, h):\n    return q + h*sin(v), v\n", 2) is None
    assert stepper.written_out("def step(t, q, v, h):\n    for i in range(2):\n        q = q + h*v\n", 2) is None


def test_an_acceleration_that_changes_its_shape_is_refused() -> None:
    with pytest.raises(MethodError, match="shape"):
        solve(lambda t, q, v: -q if t < 0.5 else np.append(-q, 0.0), [1.0, 2.0], [0.0, 0.0], [0.0, 1.0], method="rk4",
              h=0.1)
