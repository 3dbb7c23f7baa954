"""The differentiable twin in JAX: its checks run in an environment that has JAX, the rest of the package without it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from beside import environment
from readme_code import READMES, ROOT
from scipy.integrate import solve_ivp

from pendulum_env import controllers

WITH_JAX = ("jax>=0.4.35", "optax>=0.2.3")
"""Packages of the environment "jax"; optax is for the examples."""
EXAMPLES = sorted(path for path in (ROOT / "examples").glob("*.py") if "pendulum_env.jax" in path.read_text("utf-8"))
CHECKS = [(path.name, words) for path in sorted(Path(__file__).parent.glob("*_checks.py"))
          for words in (("values", "not values") if path.name == "twin_checks.py" else ("",))]
"""Files of checks, and which of theirs one test runs: the longest file is divided between two."""
BLOCKS = [code for page in READMES.values()
          for code in re.findall(r"<!-- needs the extra jax -->\n```python\n(.*?)```", page, flags=re.S)]
"""Code of READMEs that uses the twin."""
HASTY = ("--xla_disable_hlo_passes=fusion --xla_backend_optimization_level=0 "
         "--xla_llvm_disable_expensive_passes=true")
"""Options of JAX's compiler: it joins no operations and improves little, and compiles several times faster."""


@pytest.fixture(scope="session")
def with_jax(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment with the package and JAX."""
    return environment(tmp_path_factory, "jax", *WITH_JAX)


def run(python: Path | str, *words: str | Path, folder: Path = ROOT, flags: str = "") -> Any:
    support = os.pathsep.join(map(str, (ROOT / "tests" / "support", Path(__file__).parent)))
    settings = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "JAX_"))}
    return subprocess.run([python, *words], cwd=folder, capture_output=True, text=True, check=False,
                          env={**settings, "XLA_FLAGS": flags, "PYTHONPATH": support})


@pytest.mark.slow
@pytest.mark.parametrize(("checks", "words"), CHECKS)
def test_checks_pass_where_jax_is(with_jax: Path, checks: str, words: str) -> None:
    """All of them: those that quick tests would leave out, too."""
    path = Path(__file__).with_name(checks)
    done = run(with_jax, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "slow or not slow", "-k", words, path,
               flags=HASTY)
    assert done.returncode == 0, done.stdout[-20_000:] + done.stderr[-5_000:]
    assert re.search(r"^\d+ passed(, \d+ deselected)? in", done.stdout, flags=re.M), done.stdout


@pytest.mark.slow
def test_gymnaxs_own_wrappers_take_it(tmp_path_factory: pytest.TempPathFactory) -> None:
    """In an environment of its own, because gymnax holds Gymnasium below 1.4."""
    python = environment(tmp_path_factory, "gymnax", "gymnax==1.0.1", "jax>=0.6", "six")
    done = run(python, "-m", "pytest", "-q", "-p", "no:cacheprovider", Path(__file__).with_name("gymnax_loop.py"),
               flags=HASTY)
    assert done.returncode == 0, done.stdout[-20_000:] + done.stderr[-5_000:]


@pytest.mark.slow
def test_the_readmes_code_runs_where_jax_is(with_jax: Path, tmp_path: Path) -> None:
    assert BLOCKS
    for code in BLOCKS:
        done = run(with_jax, "-c", code, folder=tmp_path)
        assert done.returncode == 0, done.stderr
        assert done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_where_jax_is(with_jax: Path, path: Path, tmp_path: Path) -> None:
    done = run(with_jax, "-W", "error", path, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert any(character.isdigit() for character in done.stdout)


@pytest.mark.slow
def test_a_trained_policy_solves_the_swing_up(with_jax: Path, tmp_path: Path) -> None:
    """Of a seed, as the package's own were trained; it earns what the controller does, within 5 %, and ends upright."""
    trainer = ROOT / "examples" / "learning" / "ppo.py"
    done = run(with_jax, "-W", "error", trainer, "agents.jsonl", "--seeds", "3", "--policies", "out", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    (line,) = map(json.loads, (tmp_path / "agents.jsonl").read_text().splitlines())
    vector = gymnasium.make_vec("LabPendulum-v0", 100, diagnostics=())
    controller = controllers.evaluate(controllers.swing_up(vector), vector, 7 * 10**6).returns.mean()
    found = controllers.evaluate(controllers.load(tmp_path / "out" / "swing_up_3.npz"), vector, 7 * 10**6)
    assert found.returns.mean() > 1.05 * controller
    assert found.reached.all()
    assert line["return"] == pytest.approx(found.returns.mean(), rel=0.05)

    again = run(with_jax, trainer, "agents.jsonl", "--seeds", "3", folder=tmp_path)
    assert (again.returncode, again.stdout) == (0, "")  # the seed has its line


@pytest.mark.slow
def test_the_trainer_steps_in_the_twin_too(with_jax: Path, tmp_path: Path) -> None:
    """A policy returns more after four rounds of 32768 steps than after two; whole trainings are run by hand."""
    trainer = ROOT / "examples" / "learning" / "ppo.py"
    done = run(with_jax, "-W", "error", trainer, "agents.jsonl", "--twin", "--rounds", "4", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    (line,) = map(json.loads, (tmp_path / "agents.jsonl").read_text().splitlines())
    assert (line["what"], line["steps"]) == ("twin", 4 * 32_768)
    first, last = re.findall(r"return +(-[\d.]+),", done.stdout)
    assert float(first) < float(last) < 0.0


@pytest.mark.slow
def test_importing_the_twin_changes_no_setting_of_jax(with_jax: Path) -> None:
    code = ("import jax\nbefore = dict(jax.config.values)\nimport pendulum_env.jax\n"
            "assert dict(jax.config.values) == before\nprint(jax.numpy.zeros(1).dtype)")
    assert run(with_jax, "-c", code).stdout == "float32\n"


@pytest.mark.slow
def test_the_package_does_not_import_jax() -> None:
    code = ("import sys, pendulum_env\npendulum_env.SCENES, pendulum_env.rollout, pendulum_env.LabPendulumEnv\n"
            "print([name for name in sys.modules if name.partition('.')[0] in ('jax', 'jaxlib')])")
    assert run(sys.executable, "-c", code).stdout == "[]\n"


def test_without_jax_the_error_names_the_extra(tmp_path: Path) -> None:
    (tmp_path / "jax.py").write_text("raise ModuleNotFoundError('none', name='jax')")  # even where it is installed
    done = run(sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import pendulum_env.jax")
    assert done.stderr.splitlines()[-1].startswith("ImportError: pendulum_env.jax needs JAX, but ")
    assert "'lab-pendulum[jax]'" in done.stderr.splitlines()[-1]


# --- the benchmark ----------------------------------------------------------------------------------------------------


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.syspath_prepend(str(ROOT / "examples" / "benchmarks"))
    import jax_twin as module
    yield module
    sys.modules.pop("jax_twin")


def test_the_truth_of_gradients_is_scipys(benchmark: Any) -> None:
    """Angle and derivative after 3 s, by the variational equations in double precision."""
    def rates(_: float, y: Any) -> Any:
        q, v, p, w = y
        pull = 9.81 / benchmark.LENGTH
        return [v, -pull * np.sin(q) - benchmark.GAMMA * v, w, -pull * np.cos(q) * p - v - benchmark.GAMMA * w]

    found = solve_ivp(rates, (0.0, 3.0), [benchmark.START, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-13)
    assert benchmark.true_slope(3.0) == pytest.approx((found.y[0, -1], found.y[2, -1]), rel=1e-10)


@pytest.mark.slow
def test_the_figure_of_gradients_shows_every_solver(benchmark: Any, tmp_path: Path) -> None:
    points = {name: [(1e-3, 1.0, 2.0), (1e-6, 4.0, 5.0)] for name in ("twin rk4", "diffrax Dopri8")}
    benchmark.draw(points, 1000.0, str(tmp_path / "gradients.png"))
    assert (tmp_path / "gradients.png").stat().st_size > 10_000
