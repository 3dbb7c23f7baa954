"""Every keyword of every public function, spoilt in every way: one clear error each, and files as they were."""

from __future__ import annotations

import inspect
import re
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from check_all import check_all
from drawn_films import NAMES, draw
from folder_contents import contents
from keyword_kinds import KIND_OF, KINDS, OWN, VALUES, check_refusal, outcome
from keyword_table import BESIDE_IT, SELF, TIME, UNSPOILT, WORKING, keywords, public

from pendulum_env import compare

pytestmark = pytest.mark.usefixtures("all_interpreted")

PUBLIC = dict(public())
PAIRS = [(label, keyword.name) for label, function in PUBLIC.items() for keyword in keywords(function)]
STUDIES = (
    "audit", "simplify", "compare", "compare.write", "cost", "growth", "choose", "stress", "fit", "lab.fit_driven")
READERS = ("film", "lab.track", "lab.follow", "lab.measure_amplitudes", "lab.measure_gate", "lab.DrivenLog.read")
"""Functions that take long for each value that they accept: of films, tables and readings by hand."""


FITS = ("fit", "lab.fit_driven")
"""Functions of so many runs that they take minutes interpreted."""
LABELS = [pytest.param(
    label, marks=[pytest.mark.slow] if label in STUDIES + READERS or label.startswith("exact.") else [])
          for label in dict.fromkeys(label for label, _ in PAIRS)]
"""All functions with keywords; slow are studies, closed forms, and READERS."""


@cache
def film() -> bytes:
    """A film of a swing."""
    with tempfile.TemporaryDirectory() as folder:
        draw(replace(NAMES["plain"], seconds=2.0), Path(folder) / "swing.mp4")
        return (Path(folder) / "swing.mp4").read_bytes()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder to work in, with a recording and files that must stay as they are."""
    monkeypatch.chdir(tmp_path)
    np.savetxt("swing.txt", np.stack([TIME, np.cos(TIME)], axis=1))
    np.savetxt("driven.csv", np.stack([TIME, np.sin(TIME), np.cos(TIME)], axis=1), delimiter=",",
               header="time (s),angle (rad),action", comments="")
    np.savetxt("gate.txt", 2.0 + 0.03 * np.exp(-0.1 * np.arange(10.0)), header="Period (s)", comments="")
    Path("swing.mp4").write_bytes(film())
    for name in ("x", "1", "kept.npy", "scene.json"):
        Path(name).write_text("kept")
    before = contents(tmp_path)
    yield tmp_path
    (tmp_path / "swing.gif").unlink(missing_ok=True)  # of values that a film takes
    assert contents(tmp_path) == before


def kind_of(label: str, name: str) -> str:
    """The kind of a keyword; KeyError for one that the tables do not cover."""
    return OWN.get(f"{label}.{name}") or KIND_OF[name]


def arguments(label: str, name: str) -> dict[str, Any]:
    """Those of a call that works, with what goes with one keyword."""
    known = inspect.signature(PUBLIC[label]).parameters
    found = {**WORKING.get(label, {}), **{key: x for key, x in BESIDE_IT.get(name, {}).items() if key in known}}
    if "self" in known:
        found["self"] = SELF[label.split(".")[0]]()
    if label == "compare.write":
        found["comparison"] = compare("vacuum", "rk4", duration=0.05)
    return found


def test_every_keyword_is_covered() -> None:
    """A new function, or a new keyword, has to be put into the tables; and nothing stands there that is gone."""
    missing = [pair for pair in PAIRS if f"{pair[0]}.{pair[1]}" not in OWN and pair[1] not in KIND_OF]
    assert not missing
    assert set(OWN) <= {f"{label}.{name}" for label, name in PAIRS}
    assert set(KIND_OF) <= {name for _, name in PAIRS}
    assert set(WORKING) <= set(PUBLIC)
    assert set(BESIDE_IT) <= {name for _, name in PAIRS}
    assert not set(UNSPOILT) & set(PUBLIC)
    assert {*KIND_OF.values(), *OWN.values()} == set(KINDS)


@pytest.mark.parametrize("label", LABELS)
def test_what_cannot_be_is_refused_in_one_sentence(
    label: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    function = PUBLIC[label]
    if label in FITS:
        monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")

    def check(keyword: inspect.Parameter) -> None:
        fine, either = KINDS[kind_of(label, keyword.name)]
        usual = arguments(label, keyword.name)
        for word, value in VALUES.items():
            if word in fine or (value is None and keyword.default is None):
                continue
            error = outcome(lambda: function(**{**usual, keyword.name: value}))  # noqa: B023 (called at once)
            if error is not None or word not in either:
                check_refusal(error, what=word)

    check_all(keywords(function), check)


def test_unknown_keywords_are_named(folder: Path) -> None:
    """By Python where a function takes those of its signature alone; else with the nearest that there is."""
    def check(label: str) -> None:
        function = PUBLIC[label]
        taken = inspect.signature(function).parameters
        of_source = label == "bench.acquire"
        misspelt, meant = ("integratr", "integrator") if of_source else ("lenght", "length")
        usual = {**arguments(label, ""), misspelt: 1.0}
        if any(one.kind is inspect.Parameter.VAR_KEYWORD for one in taken.values()):
            check_refusal(outcome(lambda: function(**usual)), misspelt, f"did you mean {meant}")
            return
        with pytest.raises(TypeError, match=re.escape("lenght")):
            function(**usual)

    check_all(PUBLIC, check)


TAKING = [label for label, function in PUBLIC.items()
          if "parameters" in inspect.signature(function).parameters and label != "build_scene"]


def test_runs_and_studies_of_scenes_are_among_those_with_a_scenes_parameters() -> None:
    assert {"LabPendulumEnv", "LabPendulumVectorEnv", "rollout", "film", *STUDIES} - {
        "compare.write", "choose", "stress", "fit", "lab.fit_driven", "simplify", "audit"} <= {*TAKING}


def test_a_misspelt_keyword_is_told_from_a_scenes_parameter() -> None:
    def check(pair: tuple[str, str]) -> None:
        label, name = pair
        usual = {**arguments(label, ""), f"{name[:2]}{name[3:]}": 1.0}
        check_refusal(outcome(lambda: PUBLIC[label](**usual)), f"did you mean {name}?")

    check_all([(label, name) for label, name in PAIRS if label in TAKING and len(name) > 4], check)
