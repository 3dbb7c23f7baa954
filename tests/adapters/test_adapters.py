"""Adapters to Stable-Baselines3, TorchRL and Minari, each tested in an environment that has its program."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from beside import FOREIGN, environment
from readme_code import READMES, ROOT

ADAPTERS = ("sb3", "torchrl", "minari")
BLOCKS = {mark: code for page in READMES.values()
          for mark, code in re.findall(r"<!-- needs (\w+) -->\n```python\n(.*?)```", page, flags=re.S)}
"""Adapter -> the code of a README that uses it."""
PROGRAMS = {"sb3": "Stable-Baselines3", "torchrl": "TorchRL", "minari": "Minari"}


@pytest.fixture(scope="session")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment with the package and the foreign programs."""
    return environment(tmp_path_factory, "foreign", *FOREIGN)


@pytest.mark.slow
@pytest.mark.parametrize("adapter", ADAPTERS)
def test_adapter_in_an_environment_that_has_its_program(foreign: Path, adapter: str, tmp_path: Path) -> None:
    checks = Path(__file__).with_name(f"{adapter}_checks.py")
    done = subprocess.run([foreign, "-m", "pytest", "-q", "-p", "no:cacheprovider", checks], cwd=ROOT,
                          capture_output=True, text=True, env={**os.environ, "MINARI_DATASETS_PATH": str(tmp_path)})
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"^\d+ passed in", done.stdout, flags=re.M), done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("adapter", ADAPTERS)
def test_the_readmes_code_runs_where_its_program_is(foreign: Path, adapter: str, tmp_path: Path) -> None:
    done = subprocess.run([foreign, "-c", BLOCKS[adapter]], cwd=tmp_path, capture_output=True, text=True,
                          env={**os.environ, "MINARI_DATASETS_PATH": str(tmp_path)})
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_every_adapter_has_code_in_a_readme_and_checks() -> None:
    assert {*BLOCKS} == {*ADAPTERS}
    assert {path.name.removesuffix("_checks.py") for path in Path(__file__).parent.glob("*_checks.py")} == {*ADAPTERS}


@pytest.mark.quick("sb3")
@pytest.mark.parametrize("adapter", ADAPTERS)
def test_a_missing_program_is_told_with_the_extra_that_brings_it(adapter: str, tmp_path: Path) -> None:
    for name in ("stable_baselines3", "torch", "minari"):  # even where they are installed
        (tmp_path / f"{name}.py").write_text(f"raise ModuleNotFoundError('none', name={name!r})")
    done = subprocess.run([sys.executable, "-c", f"import pendulum_env.adapters.{adapter}"], capture_output=True,
                          text=True, check=False,
                          env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *filter(None, sys.path)])})
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"ImportError: pendulum_env.adapters.{adapter} needs {PROGRAMS[adapter]}, but ")
    assert last.endswith(f" is missing: pip install 'lab-pendulum[{adapter}]'.")


def test_the_adapters_room_loads_no_program() -> None:
    code = "import sys, pendulum_env.adapters; print({'torch', 'minari', 'stable_baselines3'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
