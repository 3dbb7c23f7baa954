"""Pages made from what the package declares: environments and tasks, commands, public names."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
import textwrap
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
from sphinx.ext.autodoc.mock import mock, undecorate

import pendulum_env
from pendulum_env.bench import LabPendulumBenchEnv
from pendulum_env.common.texts import Table
from pendulum_env.envs.limits import BENCH_ID, IDS, USUAL_ID
from pendulum_env.envs.settings import settings_table
from pendulum_env.tasks import TASKS, USUAL_TASK, Task

MOCKED = ["jax", "jaxlib", "stable_baselines3", "torch", "torchrl", "tensordict", "minari", "h5py"]
"""Packages of extras, which need not be installed for the pages of what uses them."""
ROOT = Path(__file__).resolve().parents[1]
REFERENCE: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "environments": ("Environments and tasks", (
        "pendulum_env.ENV_ID", "pendulum_env.LabPendulumEnv", "pendulum_env.LabPendulumVectorEnv", "pendulum_env.Task",
        "pendulum_env.Sensor", "pendulum_env.transfer", "pendulum_env.tasks", "pendulum_env.controllers",
        "pendulum_env.testing")),
    "adapters": ("Adapters to other libraries", (
        "pendulum_env.adapters.sb3.LabPendulumVecEnv", "pendulum_env.adapters.torchrl.LabPendulumTorchEnv",
        "pendulum_env.adapters.minari.collect")),
    "jax": ("JAX", ("pendulum_env.jax",)),
    "scenes": ("Scenes and runs", (
        "pendulum_env.SCENES", "pendulum_env.Scene", "pendulum_env.Run", "pendulum_env.rollout", "pendulum_env.Rollout",
        "pendulum_env.code", "pendulum_env.load", "pendulum_env.SceneError")),
    "effects": ("Effects", ("pendulum_env.physics.effects",)),
    "bodies": ("Bodies, media and dampings", (
        "pendulum_env.physics.bodies.Rod", "pendulum_env.physics.bodies.Disc", "pendulum_env.physics.bodies.Kater",
        "pendulum_env.physics.bodies.MeasuredBody", "pendulum_env.physics.bodies.Torsion",
        "pendulum_env.physics.body.Body", "pendulum_env.physics.medium.Medium",
        "pendulum_env.physics.damping.with_damping")),
    "exact": ("Closed forms", ("pendulum_env.physics.exact",)),
    "recordings": ("Recordings and fits", (
        "pendulum_env.Recording", "pendulum_env.VirtualSensor", "pendulum_env.measure", "pendulum_env.fit",
        "pendulum_env.lab")),
    "bench": ("Sensors live, and a bench", ("pendulum_env.bench",)),
    "studies": ("Studies", (
        "pendulum_env.compare", "pendulum_env.cost", "pendulum_env.growth", "pendulum_env.audit",
        "pendulum_env.simplify", "pendulum_env.section", "pendulum_env.basins", "pendulum_env.stress",
        "pendulum_env.sweep", "pendulum_env.Sweep", "pendulum_env.Study",
        "pendulum_env.study.compare", "pendulum_env.study.section", "pendulum_env.study.basins",
        "pendulum_env.study.growth", "pendulum_env.study.stability", "pendulum_env.auto.choice")),
    "figures": ("Figures, frames, films, and the page", (
        "pendulum_env.film", "pendulum_env.plots", "pendulum_env.render", "pendulum_env.window", "pendulum_env.web")),
    "integrators": ("Integrators", ("integrators", "integrators.method")),
    "analysis": ("Analysis of integrators", ("integrators.analysis",)),
}
"""Page -> its title, and the public names on it; of a module those in its ``__all__`` that no earlier entry has."""
DESCRIBED: Mapping[str, str] = {
    "free": "Let go and watched: nothing is rewarded.",
    "swing_up": "Swing the bob up, with a motor that is too weak to lift it directly, and hold it there.",
    "swing_up_anywhere": "Swing the bob up and hold it there, from any angle, with up to omega0.",
    "swing_up_mixed": "Swing the bob up and hold it there: one episode in four begins hanging, the others anywhere.",
    "balance": "Hold the bob upright, from a start near the top.",
    "swing_up_sparse": "Swing up and hold, with a reward at the top alone.",
    "track": "Follow a reference angle, by default a slow swing.",
    "gymnasium": "The task of Gymnasium's Pendulum-v1.",
    "dm_control": "The task of the pendulum of dm_control.",
}
"""Task -> what it asks of an agent, in a sentence; a task without one has its reward alone."""
STARTS: Mapping[str, str] = {
    "swing_up_mixed": "At random: in one episode of four as in `swing_up`, in the others as in `swing_up_anywhere`.",
}
"""Task -> where its episodes start, in a sentence, if angle and velocity are not uniform in a range."""


def pages() -> Iterator[tuple[str, str]]:
    """Yield each page that is made from declarations: its file on the site, and its text."""
    yield from environments()
    yield from commands()
    with mock(MOCKED):
        for page, (title, names) in REFERENCE.items():
            yield f"reference/{page}.rst", f"{title}\n{'=' * len(title)}\n\n" + "\n".join(objects(names))


# --- environments and tasks -----------------------------------------------------------------------------------------


def parts(docstring: str) -> dict[str, str]:
    """Return the sections of an environment's docstring by their titles; a section of a README becomes a link."""
    linked = re.sub(r"the section (\w+) of ``([\w/]+)/README\.md``", lambda found:
                    f"[the section {found[1]}](/{found[2]}/{found[1].lower()}.md)", textwrap.dedent(docstring))
    found = re.split(r"^## (.*)\n", linked, flags=re.M)
    return {title: text.strip() for title, text in zip(found[1::2], found[2::2], strict=True)}


def environments() -> Iterator[tuple[str, str]]:
    """Yield a page for each id, one for each task, and their list."""
    usual = parts(pendulum_env.LabPendulumEnv.__doc__ or "")
    rows = [f"| [{name}]({name}.md) | [{task}]({task}.md) | {made.steps} | {made.reward_threshold:g} |"
            for name, made in IDS.items() for task in [made.keywords.get("task", USUAL_TASK)]]
    table = "\n".join(("| id | task | control steps of an episode | solved from |", "| --- | --- | --- | --- |", *rows))
    yield "environments/index.md", "\n".join((
        "# Environments and tasks", "", "A page for each id of `gym.make` and `gym.make_vec`, and for each task.", "",
        table, "", f"[`{BENCH_ID}`]({BENCH_ID}.md) is a motor and an encoder, in real time.", "",
        "```{toctree}", ":maxdepth: 1", "", *IDS, BENCH_ID, *TASKS, "```", ""))
    for name, made in IDS.items():
        task = TASKS[made.keywords.get("task", USUAL_TASK)]
        solved = f"a mean return of {made.reward_threshold:g} in 100 episodes, `env.spec.reward_threshold`"
        sets = f"\n\nIt sets {listed(made.keywords)}." * bool(made.keywords)
        text = f"{spaces(name, {})}\n| solved from | {solved} |{sets}"
        whole = name == USUAL_ID
        sections = {
            "Description": usual["Description"] if whole else
            f"{DESCRIBED.get(task.name, '')} All else is that of [{USUAL_ID}]({USUAL_ID}.md).",
            "Action space": usual["Action Space"],
            "Observation space": usual["Observation Space"] if whole else seen(task),
            "Rewards": usual["Rewards"] if whole else reward(task),
            "Starting state": usual["Starting State"] if whole else start(task),
            "Episode end": usual["Episode End"] if whole else end(task, made.steps), "Info": usual["Info"],
            "Arguments": f"Beside any parameter of the scene by its name:\n\n{arguments()}",
            "Learning curve": curve(name, task.name), "Version history": usual["Version History"]}
        yield f"environments/{name}.md", page(name, text, sections)
    bench = parts(LabPendulumBenchEnv.__doc__ or "")
    yield f"environments/{BENCH_ID}.md", page(BENCH_ID, "", bench)
    for task in TASKS.values():
        text = spaces(USUAL_ID, {"task": task.name})
        sections = {
            "Description": DESCRIBED.get(task.name, ""), "Action space": usual["Action Space"],
            "Observation space": seen(task), "Rewards": reward(task), "Starting state": start(task),
            "Episode end": end(task, IDS[USUAL_ID].steps),
            "Arguments": f"Those of [{USUAL_ID}]({USUAL_ID}.md#arguments).",
            "Learning curve": curve(task.name), "Version history": usual["Version History"]}
        yield f"environments/{task.name}.md", page(f"Task {task.name}", text, sections)


def page(title: str, text: str, sections: Mapping[str, str]) -> str:
    """Return a page of sections."""
    return "\n\n".join((f"# {title}", text, *(f"## {name}\n\n{said}" for name, said in sections.items() if said), ""))


def arguments() -> str:
    """Return the table of settings; defaults stand beside meanings, as three columns are too wide for a phone."""
    rows = ((name, f"{meaning} (default {default})") for name, default, meaning in settings_table().rows)
    return Table(("keyword", "meaning and default"), tuple(rows)).markdown()


def curve(*names: str) -> str:
    """Return the first picture of learning that exists for an id or a task."""
    files = [f"examples/figures/learning_{name}.png" for name in names]
    return next((f"![Return against steps](/{file})" for file in files if (ROOT / file).exists()), "")


def listed(keywords: Mapping[str, Any]) -> str:
    """Return keywords as code."""
    return ", ".join(f"`{name}={value!r}`" for name, value in keywords.items())


def spaces(name: str, keywords: Mapping[str, Any]) -> str:
    """Return the table at the head of a page: how it is made, and its spaces."""
    env = gymnasium.make(name, backend="python", warn=False, **keywords)
    made = "".join(f", {key}={value!r}" for key, value in keywords.items())
    env.close()
    found = [(each, *re.subn(r"-?3\.4028235e\+38", "unbounded", " ".join(text.replace(".0000000e+00", ".").split())))
             for each, text in (("action", str(env.action_space)), ("observation", str(env.observation_space)))]
    return "\n".join((
        f"| made by | `import pendulum_env; gym.make(\"{name}\"{made})` |", "| --- | --- |",
        *(f"| {each} space | `{space}`{', where unbounded is the largest float32' * bool(cut)} |"
          for each, space, cut in found)))


def reward(task: Task) -> str:
    """Return what a control step earns in a task."""
    return (f"In each control step `{task.equation}`. phi is the angle from upright in [-pi, pi], error the angle less "
            "the reference, omega0 the angular frequency of small swings.")


def start(task: Task) -> str:
    """Return where a task's episodes start, from the function that starts them."""
    if not task.draws:
        return "The scene's usual run."
    if task.name in STARTS:
        return STARTS[task.name]
    drawn = np.array([task.starts(x, x, 1.0) for x in (0.0, 0.25, 0.5, 0.75, 1.0)])
    if np.ptp(np.diff(drawn, axis=0), axis=0).max() > 1e-12:
        raise ValueError(f"The task {task.name} draws no uniform start; say in STARTS where its episodes start.")
    (low, slow), (high, fast) = (task.starts(x, x, 1.0) for x in (0.0, 1.0))
    (_, slower), (_, faster) = (task.starts(x, x, 2.0) for x in (0.0, 1.0))
    unit = "omega0" if (slower, faster) != (slow, fast) else "rad/s"
    return (f"At random, uniform: the angle from hanging in [{low:.4g}, {high:.4g}] rad, the velocity in "
            f"[{slow:.4g}, {fast:.4g}] {unit}.")


def seen(task: Task) -> str:
    """Return what is observed in a task."""
    angle = "the angle from upright" if task.upright else "theta, the angle from hanging"
    more = ("; then cosine and sine of the reference now, and after the next control step" if task.reference else "")
    return f"Cosine and sine of {angle}, and the angular velocity [rad/s]{more}."


def end(task: Task, steps: int) -> str:
    """Return when a task's episodes end."""
    lost = "" if task.ends == "-" else f" The task is lost where `{task.ends}`."
    length = f"after {task.duration:g} s" if task.duration else f"after {steps} control steps"
    return (f"Truncated {length}, or by `duration` and `max_episode_steps`.{lost} Other ends are those of "
            f"[{USUAL_ID}]({USUAL_ID}.md#episode-end).")


# --- commands -------------------------------------------------------------------------------------------------------


def commands() -> Iterator[tuple[str, str]]:
    """Yield a page for each command, as typer documents it, and their list."""
    words = ["-m", "typer", "pendulum_env.cli", "utils", "docs", "--name", "lab-pendulum"]
    made = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=True, encoding="utf-8").stdout
    _, *others = re.split(r"^## ", made.replace("$ lab-pendulum", "lab-pendulum"), flags=re.M)
    names = []
    for text in others:
        title, _, body = text.partition("\n")
        names.append(title.strip("` ").split()[1])
        yield f"commands/{names[-1]}.md", f"# {title.strip('` ')}\n{body.replace('```console', '```sh')}"
    yield "commands/index.md", "# Commands\n\n" + "\n".join((
        "Each with its options; `lab-pendulum COMMAND --help` prints the same.", "", "```{toctree}", ":maxdepth: 1", "",
        *names, "```", ""))


# --- public names ---------------------------------------------------------------------------------------------------

_seen: set[int] = set()


def objects(names: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines that show public names; what an earlier page or entry shows is left out."""
    for name in names:
        module, _, last = name.rpartition(".")
        value = imported(name)
        if isinstance(value, ModuleType):
            inner = [each for each in value.__all__ if not isinstance(getattr(value, each), ModuleType)]
            lines = [line for each in inner for line in shown(name, each, getattr(value, each))]
            if lines:
                yield from (f".. rubric:: {name}", "", f".. automodule:: {name}", "   :no-index:", "", *lines)
        else:
            yield from shown(module, last, value)


def imported(name: str) -> Any:
    """Return a module, or a public name of a module."""
    module, _, last = name.rpartition(".")
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name and not str(error).endswith("is not a package"):
            raise
        return getattr(import_module(module), last)


def shown(module: str, name: str, value: Any) -> Iterator[str]:
    """Yield the lines that show a public name, unless it has been shown."""
    value = undecorate(value)  # of a package that is not there
    if id(value) in _seen:
        return
    _seen.add(id(value))
    yield from (name, "-" * len(name), "")
    if inspect.isclass(value):
        kind = "exception" if issubclass(value, BaseException) else "class"
        yield from (f".. auto{kind}:: {module}.{name}", "   :members:", "")
    elif callable(value):
        yield from (f".. autofunction:: {module}.{name}", "")
    else:
        yield from (f".. autodata:: {module}.{name}", "   :no-value:", "")
