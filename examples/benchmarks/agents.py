"""Agents of Stable-Baselines3 for the benchmarks: trained once, and their results kept in files."""

from __future__ import annotations

import argparse
import importlib.util
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym

Policy = Callable[[Any], Any]

EXAMPLE = Path(__file__).parent.parent / "11_train_swing_up.py"


def parser_of(about: str | None, folder: str) -> argparse.ArgumentParser:
    """Return the parser of a benchmark's options; ``folder`` is the usual one of its agents' results."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="agents trained for each row")
    parser.add_argument("--only-seed", type=int, help="train only agents with this seed; others are read")
    parser.add_argument("--share", type=float, default=1.0, help="fraction of the training steps to take")
    parser.add_argument("--episodes", type=int, default=1000, help="episodes of each policy")
    parser.add_argument("--rows", default="", help="rows with this text in their names")
    parser.add_argument("--folder", type=Path, default=Path(folder), help="folder of the agents' results")
    return parser


def options_of(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Return the options; fewer than two seeds or episodes, which have no standard deviation, end the program."""
    options = parser.parse_args()
    if options.seeds < 2 or options.episodes < 2:
        parser.error("--seeds and --episodes must be 2 or more, for a standard deviation")
    return options


def can_train() -> bool:
    """Return True if Stable-Baselines3 can be imported."""
    return importlib.util.find_spec("stable_baselines3") is not None


def ppo(task: str, budget: int, seed: int, **keywords: Any) -> Policy:
    """Train PPO as example 11 does; return its policy."""
    spec = importlib.util.spec_from_file_location("training", EXAMPLE)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    assert spec.loader is not None
    spec.loader.exec_module(module)
    policy: Policy = module.trained(task, budget, seed, **keywords)[0]
    return policy


def learnt(algorithm: str, budget: int, seed: int, path: Path, settings: dict[str, Any], **keywords: Any) -> Policy:
    """Train one of Stable-Baselines3's algorithms on one environment and store it in ``path``; return its policy."""
    import stable_baselines3
    import torch

    torch.set_num_threads(1)
    env = gym.make("LabPendulum-v0", diagnostics=(), warn=False, **keywords)
    model: Any = getattr(stable_baselines3, algorithm)("MlpPolicy", env, seed=seed, device="cpu", **settings)
    model.learn(budget)
    model.save(path)
    return lambda seen: model.predict(seen, deterministic=True)[0]


def loaded(path: Path) -> Policy | None:
    """Return the policy of an agent that SAC has trained before; None if there is none."""
    if not (can_train() and path.with_suffix(".zip").exists()):
        return None
    from stable_baselines3 import SAC

    model = SAC.load(path, device="cpu")
    return lambda seen: model.predict(seen, deterministic=True)[0]


def kept(path: Path, may_work: bool, work: Callable[[], dict[str, Any]]) -> dict[str, Any] | None:
    """Return an agent's result from the file ``path`` + ".json"; else that of ``work``, which is then stored.

    ``seconds`` is its processor time. None if there is no file and no work may be done.
    """
    file = path.parent / f"{path.name}.json"
    if file.exists():
        result: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        return result
    if not may_work:
        return None
    file.parent.mkdir(parents=True, exist_ok=True)
    began = time.process_time()
    done = work()
    done = {**done, "seconds": time.process_time() - began}
    part = path.parent / f"{path.name}.part"
    part.write_text(json.dumps(done), encoding="utf-8")
    part.replace(file)
    return done
