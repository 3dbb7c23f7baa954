"""READMEs cannot rot: their code runs, and the commands, links, figures and numbers in them are right."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_films import NAMES, draw
from readme_code import README, READMES, ROOT, without_code

from pendulum_env import rollout
from pendulum_env.cli import COMMANDS

BLOCKS = [(name, mark, code) for name, page in READMES.items()
          for mark, code in re.findall(r"(?:<!-- ([\w ]+) -->\n)?```python\n(.*?)```", page, flags=re.S)]
"""Page, mark and code."""
FOREIGN = "needs "
"""Beginning of the marks of code that runs in an environment of its own, in tests/adapters."""
MANY = ("= simulated_recording()", "num_envs=1000)", "angle=np.linspace", "= section(",
        "fit_driven(log", "= transfer(", 'track("swing.mp4"', "import film")
"""Texts of blocks with too many steps to be interpreted."""
ROOMS = ("integrators", "pendulum_env/physics", "pendulum_env/engine", "pendulum_env/lab", "pendulum_env/bench",
         "pendulum_env/exercise", "pendulum_env/study", "pendulum_env/web", "pendulum_env/envs", "pendulum_env/jax",
         "pendulum_env/hard_cases", "pendulum_env/testing", "examples/benchmarks", "examples/learning", "tests")
"""Folders that have a page of their own."""
FILM = {"angle": math.radians(60.0), "velocity": 0.0, "dt": 0.01, "damping": "none", "suspension": "rod",
        "backend": "python"}
"""The run in the film on the front page."""


@pytest.mark.parametrize("block", [
    pytest.param(code, id=f"{name}-{mark or i}", marks=[pytest.mark.slow] if mark else [])
    for i, (name, mark, code) in enumerate(BLOCKS) if not mark.startswith(FOREIGN)])
def test_python_blocks_run(
    block: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a file: the engine reads the source of an effect's functions.

    Blocks of few steps are interpreted, which has the same bits. Marked ones have quick tests of their own, or take
    seconds.
    """
    monkeypatch.chdir(tmp_path)
    if '"swing.mp4"' in block:
        draw(replace(NAMES["plain"], seconds=9.0), tmp_path / "swing.mp4")
    if not any(text in block for text in MANY):
        monkeypatch.setenv("LAB_PENDULUM_BACKEND", "python")
    if "LabPendulumBench" in block:  # in real time, which a busy machine does not keep
        warnings.filterwarnings("ignore", "An action came .* after its observation")
    path = tmp_path / "block.py"
    path.write_text(block, encoding="utf-8")
    exec(compile(block, str(path), "exec", dont_inherit=True), {"__name__": "block"})
    assert capsys.readouterr().out


def test_every_room_has_its_page_and_the_front_page_is_short_and_leads_to_all() -> None:
    assert {*READMES} == {"README.md", *(f"{room}/README.md" for room in ROOMS)}
    assert len(README.splitlines()) < 150
    assert {f"{room}/README.md" for room in ROOMS} <= {*re.findall(r"\]\(([^)#]+)\)", README)}


def test_there_are_blocks_and_both_commands() -> None:
    assert {*READMES} - {name for name, _, _ in BLOCKS} == {
        "examples/benchmarks/README.md", "examples/learning/README.md", "tests/README.md"}
    assert any(name == "README.md" and not mark for name, mark, _ in BLOCKS)
    for mark in ("main job", "tests"):
        assert re.search(rf"<!-- {mark} -->\n```sh\n.+\n```", README)


def test_powershell_is_given_the_commands_of_bash() -> None:
    """On lines of their own: version 5 has no ``&&``. Those for the tests stand where developers read."""
    bash = re.findall(r"<!-- (?:main job|tests) -->\n```sh\n(.+)\n```", README)
    pages = README + (ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
    powershell = re.findall(r"```powershell\n(.*?)\n```", pages, flags=re.S)
    assert len(powershell) == 2
    for one, other in zip(bash, powershell, strict=True):
        assert "&&" not in other
        words = [line.replace(".venv\\Scripts\\", ".venv/bin/").replace('"', "") for line in other.splitlines()]
        words[0] = re.sub("^py ", "python3 ", words[0])
        assert words == one.replace('"', "").split(" && ")
    for other in re.findall(r"```sh\n(.*?)\n```", README, flags=re.S):
        assert "&&" not in other or other in bash


def anchors(page: str) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", without_code(page), flags=re.M)
    return {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


def broken(page: str, folder: Path) -> list[str]:
    """Return the relative links of a page that lead to no file, or to no heading of another page."""
    found = []
    for target in re.findall(r"\]\((?!https?:)([^)]+)\)", without_code(page)):
        name, _, heading = target.partition("#")
        path = folder / name
        there = path.resolve().is_relative_to(ROOT) and path.exists() if name else True
        text = path.read_text(encoding="utf-8") if name and there and heading else page
        if not there or (heading and heading not in anchors(text)):
            found.append(target)
    return found


def test_links_lead_to_files_and_headings_that_exist() -> None:
    found = {name: broken(page, (ROOT / name).parent) for name, page in READMES.items()}
    assert {name: links for name, links in found.items() if links} == {}


def test_blocks_of_many_steps_are_there() -> None:
    assert all(any(text in code for _, _, code in BLOCKS) for text in MANY)


def test_links_that_lead_nowhere_are_noticed() -> None:
    page = "# One place\n[a](#one-place) [b](#another) [c](README.md#start) [d](README.md#end) [e](nowhere.md) [f](..)"
    assert broken(page, ROOT) == ["#another", "README.md#end", "nowhere.md", ".."]


def test_paths_that_are_named_exist() -> None:
    """From the project's folder, as all pages name them."""
    folders = r"integrators|pendulum_env|tests|examples|\.ci|\.github|\.site"
    assert [(name, path) for name, page in READMES.items() for path in re.findall(
        rf"`((?:{folders})/[^`<*]*)`", without_code(page)) if not (ROOT / path).exists()] == []


def test_every_command_is_in_the_table_and_only_those() -> None:
    assert set(re.findall(r"^\| `lab-pendulum (\w+)`", README, flags=re.M)) == {*COMMANDS}


def test_numbers_of_the_front_page_are_those_of_the_results() -> None:
    """Each with its command, word for word; what misses its goal is bold on both pages."""
    rows = re.findall(r"^\| .* \| (.*) \| (.*) \| (`python .*`|the same) \|$", README, flags=re.M)
    assert len(rows) == 6
    assert re.search(r"^\| .*\*\*.* \|$", READMES["examples/benchmarks/README.md"], flags=re.M), "some do miss theirs"
    results = " ".join(" ".join(page.split()) for name, page in READMES.items() if name != "README.md")
    for measured, goal, command in rows:
        assert measured in results
        verdict = "missed" if "**" in measured else "met"
        assert goal == "-" or f"| {measured} | {goal} |" in results or f"our goal is {goal}, {verdict}" in results
        assert command == "the same" or command in results


def test_the_caption_of_the_film_is_true() -> None:
    caption = " ".join(README.split("three_eulers.gif)")[1].split("Filmed by")[0].split())
    assert "swings out to 107° in these five seconds, and goes over the top at 9.55 s" in caption
    assert "Backward Euler loses energy; symplectic Euler holds it" in caption
    run = rollout("exercise_large", integrator="forward_euler", duration=10.0, **FILM)
    degrees = np.degrees(np.abs(run.angle))
    assert degrees[run.time <= 5.0 + 1e-9].max() == pytest.approx(107.0, abs=0.5)
    assert run.time[np.argmax(degrees > 180.0)] == pytest.approx(9.55, abs=0.005)
    for method, least, most in (("backward_euler", 0.0, 0.5), ("symplectic_euler", 0.95, 1.05)):
        run = rollout("exercise_large", integrator=method, duration=5.0, **FILM)
        assert least < run.energy[-1] / run.energy[0] < most
