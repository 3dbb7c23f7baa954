"""Runs of generated programs in Python and, translated to JavaScript, in Node, with digests of every bit.

``python tests/support/in_node.py`` runs every scene with every method that fits it, 1000 steps each (fixed, adaptive
and compensated), and prints how many differ; it takes about 20 minutes on one core.
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, Scene
from pendulum_env.engine.generate import Program, program
from pendulum_env.engine.javascript import javascript
from pendulum_env.engine.machine import Machine, fitting
from pendulum_env.engine.shape import BOUND

NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="node, which runs JavaScript, is not installed")
CALLS = 50
"""Calls of a run, each with a control of its own."""
TRIES = 1e6
"""Largest number of attempts in one call of an adaptive run."""

RUNNER = """
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";

for (const job of JSON.parse(readFileSync(process.argv[2], "utf8"))) {
  const { run } = await import(job.module);
  const [state, params, controls] = [job.state, job.params, job.controls].map((row) => row.map(Number));
  const hash = createHash("sha256");
  const codes = [];
  for (const control of controls) {
    const out = Array.from({ length: job.rows + 1 }, () => new Float64Array(job.width));
    const seen = [0, 0, 0];
    codes.push(run(state, params, control, job.h, job.rows, 1, Infinity, out, seen));
    for (const row of [...out, Float64Array.from(state), Float64Array.from(seen)]) {
      hash.update(new Uint8Array(row.buffer));
    }
    if (codes.at(-1) !== 0) break;
  }
  console.log(JSON.stringify([codes, hash.digest("hex")]));
}
"""


@dataclass(frozen=True)
class Case:
    """A run to compare: a scene or its name, a method, and how it steps ("fixed", "adaptive" or "compensated")."""

    scene: str | Scene
    method: str
    steps: str = "fixed"

    @property
    def place(self) -> Scene:
        """Return the scene itself, which may be given by its name."""
        return SCENES[self.scene] if isinstance(self.scene, str) else self.scene

    def machine(self) -> Machine:
        """Return the interpreted simulator."""
        rtol = 1e-6 if self.steps == "adaptive" else None
        return Machine(self.place, self.method, backend="python", rtol=rtol,
                       compensated=self.steps == "compensated")

    def program(self) -> Program:
        """Return the generated program."""
        adaptive, compensated = self.steps == "adaptive", self.steps == "compensated"
        return program(self.place, integrators.get(self.method), ("energy",), adaptive, compensated)


def cases_of(scene: str, methods: Iterable[str]) -> list[Case]:
    """Return methods in a scene that they fit, with fixed steps, adaptive where they can, compensated where they can.
    """
    cases = []
    for name in methods:
        for steps in ("fixed", "adaptive", "compensated"):
            try:
                Case(scene, name, steps).machine()
            except integrators.MethodError:  # no error estimate, or no compensated sums
                assert steps != "fixed"
            else:
                cases.append(Case(scene, name, steps))
    return cases


def differing(cases: Sequence[Case], steps: int, place: Path) -> list[Case]:
    """Return the cases whose run in Node differs from that in Python in any bit, with steps of 0.01 s."""
    them = in_node(cases, 0.01, steps, place)
    return [case for case, found in zip(cases, them, strict=True) if found != in_python(case, 0.01, steps)]


def controls(scene: Any) -> list[float]:
    """Return the control of each call: between -1 and 1 where the scene has a motor, else 0."""
    return [round(math.sin(1.7 * k), 3) if scene.has("motor") else 0.0 for k in range(CALLS)]


def in_python(case: Case, h: float, steps: int) -> tuple[list[int], str]:
    """Return the stop codes and the digest of a run of an interpreted program."""
    machine, digest, codes = case.machine(), hashlib.sha256(), []
    state, params, rows = *_start(machine), steps // CALLS
    for control in controls(machine.scene):
        out, seen = np.zeros((rows + 1, machine.width)), [0.0] * 3
        codes.append(int(machine.entry(state, params, control, h, rows, 1, math.inf, out, seen)))
        for row in (out, np.array(state), np.array(seen)):
            digest.update(np.where(np.isnan(row), np.nan, row).tobytes())
        if codes[-1]:
            break
    return codes, digest.hexdigest()


def in_node(
    cases: Sequence[Case], h: float, steps: int, place: Path, modules: Sequence[str] = ()
) -> list[tuple[list[int], str]]:
    """Return the stop codes and the digests of runs of programs in Node; ``modules`` replaces their texts."""
    jobs = []
    for i, case in enumerate(cases):
        machine = case.machine()
        state, params = _start(machine)
        path = place / f"program{i}.mjs"
        path.write_text(modules[i] if modules else javascript(case.program()), encoding="utf-8")
        jobs.append({
            "module": str(path), "width": machine.width, "h": h, "rows": steps // CALLS,
            "state": [repr(x) for x in state], "params": [repr(x) for x in params],
            "controls": [repr(x) for x in controls(machine.scene)],
        })
    (place / "jobs.json").write_text(json.dumps(jobs), encoding="utf-8")
    (place / "runner.mjs").write_text(RUNNER, encoding="utf-8")
    assert NODE is not None
    done = subprocess.run([NODE, str(place / "runner.mjs"), str(place / "jobs.json")], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    return [(codes, digest) for codes, digest in lines]


def _start(machine: Machine) -> tuple[list[float], list[float]]:
    """Return the state at the start and the parameters, as lists."""
    # A wire that starts above the horizontal would be slack at once.
    angle = 1.2 if machine.scene.body.suspension == "wire" else 2.5
    state, params = list(machine.state(angle, 3.0)), list(machine.parameters)
    if machine.tolerance:
        params[machine.numbers.index(BOUND[0])] = TRIES
    return [float(x) for x in state], [float(x) for x in params]


if __name__ == "__main__":
    for scene in SCENES:
        with TemporaryDirectory() as folder:
            cases = cases_of(scene, fitting(SCENES[scene]))
            found = differing(cases, 1000, Path(folder))
            print(f"{scene}: {len(cases)} programs, {len(found)} differ{': ' if found else ''}"
                  f"{', '.join(f'{case.method} {case.steps}' for case in found)}", flush=True)
