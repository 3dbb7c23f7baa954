"""Tests of studies of one's own: what follows from settings, points and a function, without further code."""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
from small_study import Speeds

import pendulum_env
from pendulum_env import SCENES, SceneError, Study
from pendulum_env.cli.studies import run_command
from pendulum_env.common.results import write
from pendulum_env.physics.units import choice, setting
from pendulum_env.truth.reference import StudyError

OMEGA0 = SCENES["vacuum"].omega0


def largest(angle: float) -> float:
    """Largest velocity of a swing from rest by the conservation of energy [rad/s]."""
    return 2.0 * OMEGA0 * math.sin(angle / 2.0)


def check(rows: list[dict[str, float]]) -> None:
    """Check the rows of a study against the energy; the velocity is recorded every 5 ms."""
    assert rows
    for row in rows:
        assert float(row["largest"]) == pytest.approx(largest(float(row["angle"])), rel=2e-4)


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(line for line in path.read_text().splitlines() if line[0] != "#"))


def test_a_study_has_rows_table_files_and_figure(tmp_path: Path) -> None:
    found = Speeds(number=3, both=True)()
    check(list(found.rows))
    assert [row["angle"] for row in found.rows] == pytest.approx([2 / 3, 4 / 3, 2.0] * 2)
    assert found.table.head == ("angle [rad]", "side", "largest [rad/s]")
    assert found.title == "Largest velocity of a swing without losses"
    assert found.text == f"The largest of all is {max(found.column('largest')):.4g} rad/s."
    paths = write(found, tmp_path, svg=True)
    assert [path.name for path in paths] == ["speeds.png", "speeds.svg", "speeds.csv"]
    check(rows_of(tmp_path / "speeds.csv"))
    head = (tmp_path / "speeds.csv").read_text()
    assert "# number: 3\n" in head
    assert '# Units: {"angle": "rad", "side": "", "largest": "rad/s"}\n' in head
    assert "# both: true\n" in head
    kept = json.loads(found.to_json())["tables"]["speeds"]
    assert kept["units"] == {"angle": "rad", "side": "", "largest": "rad/s"}
    assert kept["columns"]["largest"] == found.column("largest")
    frame = found.to_pandas()
    assert list(frame["largest"]) == found.column("largest")
    data = found.to_xarray()
    assert dict(data.sizes) == {"angle": 3, "side": 2}
    assert float(data.largest.sel(side="left", angle=2.0)) == found.rows[-1]["largest"]
    assert data.largest.attrs["units"] == "rad/s"


def test_it_is_saved_as_a_sweep(tmp_path: Path) -> None:
    """With its rows, units and settings; the class of a study of one's own is code, and no file has that."""
    found = Speeds(number=2)()
    kept = pendulum_env.load(found.save(tmp_path / "speeds.zip"))
    assert type(kept) is pendulum_env.Sweep
    assert kept.rows == found.rows
    assert dict(kept.units()) == dict(found.units())
    assert json.loads(kept.to_json())["provenance"]["number"] == "2"


def test_it_shows_itself() -> None:
    found = Speeds(number=2)()
    assert repr(found) == "<StudyResult: Speeds(number=2), 2 of 2 points>"
    html = found._repr_html_()
    for words in ("Largest velocity of a swing", "number", "<img", "The largest of all is"):
        assert words in html
    assert len(found.plot().axes) == 1


class Bare(Speeds):
    """A study without a figure."""

    draw = Study.draw
    text = Study.text


def test_a_study_without_a_figure(tmp_path: Path) -> None:
    found = Bare(number=1)()
    assert [path.name for path in write(found, tmp_path)] == ["speeds.csv"]
    assert "<img" not in found._repr_html_()
    assert found.text == ""
    with pytest.raises(SceneError, match="There is no figure of a StudyResult; its numbers are in its table"):
        found.plot()


def test_it_continues_from_its_journal(tmp_path: Path) -> None:
    """After Ctrl-C the rows so far are there and say so; the rest is computed later, and nothing twice."""
    path, study = tmp_path / "a.jsonl", Speeds(number=5)

    def stop(point: object, result: object) -> None:
        if len(path.read_text().splitlines()) == 3:
            raise KeyboardInterrupt

    found = study(file=path, on_row=stop)
    assert (len(found.rows), found.complete) == (2, False)
    assert found.text.endswith("Interrupted: 2 of 5 points are done.")
    assert '"Complete": "false"' in found.to_json()
    told = []
    rest = study(file=path, on_row=lambda point, result: told.append(point["angle"]))
    assert told == pytest.approx([1.2, 1.6, 2.0])
    check(list(rest.rows))
    before = path.read_bytes()
    with pytest.raises(StudyError, match="belongs to another sweep"):
        Speeds(number=5, integrator="velocity_verlet")(file=path)
    assert path.read_bytes() == before
    assert len(Speeds(number=2)(file=path, anew=True).rows) == 2


def test_other_settings_are_another_study(tmp_path: Path) -> None:
    """Also where the points are the same: the journal of one method is not continued by the other."""
    path = tmp_path / "a.jsonl"
    first = Speeds(number=1)(file=path)
    with pytest.raises(StudyError, match="integrator='velocity_verlet'"):
        Speeds(number=1, integrator="velocity_verlet")(file=path)
    assert Speeds(number=1)(file=path).rows == first.rows


def test_a_default_that_was_changed_is_another_study(tmp_path: Path) -> None:
    """The journal has all settings, not those alone that differ from their defaults: else rows of both would mix."""
    @dataclass(frozen=True)
    class Changed(Speeds):
        """The same study after an edit."""

        integrator: str = choice("velocity_verlet", ("rk4", "velocity_verlet"), "the method")

    Changed.__name__ = Speeds.__name__
    Speeds(number=1)(file=tmp_path / "a.jsonl")
    with pytest.raises(StudyError, match="belongs to another sweep"):
        Changed(number=1)(file=tmp_path / "a.jsonl")


@dataclass(frozen=True)
class Words(Speeds):
    """A study with a word among its settings that also names a separator."""

    word: str = choice("space", ("space", "comma"), "a word")
    scene: object = setting(SCENES["vacuum"], "a scene")
    method: object = setting(pendulum_env.rollout, "anything")


def test_words_are_taken_as_they_stand_and_all_settings_are_in_the_head(command, tmp_path: Path) -> None:
    code, _, said = command("--word", "comma", "--number", "1", kind=Words)
    assert (code, said) == (0, "")
    head = (tmp_path / "out" / "speeds" / "speeds.csv").read_text()
    assert "# word: comma\n" in head
    assert '"name": "vacuum"' in head
    assert "# method: \"<function rollout" in head


@pytest.mark.slow
def test_ctrl_c_says_how_to_go_on(command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """130 is the exit code; the rows so far are written."""
    run = Speeds.run
    monkeypatch.setattr(Speeds, "run", lambda self, point: run(self, point) if point["angle"] < 1.0 else stop())
    code, printed, said = command("--number", "4")
    assert code == 130
    assert "Interrupted: 1 of 4 points are done." in printed
    assert "--resume continues the study" in said
    assert len(rows_of(tmp_path / "out" / "speeds" / "speeds.csv")) == 1
    monkeypatch.setattr(Speeds, "run", run)
    code, printed, _ = command("--number", "4", "--resume")
    assert (code, "Interrupted" in printed) == (0, False)
    assert len(rows_of(tmp_path / "out" / "speeds" / "speeds.csv")) == 4


def stop() -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_it_runs_in_an_executor(pool: type) -> None:
    with pool(2) as executor:
        assert Speeds(number=4)(executor).rows == Speeds(number=4)().rows


def test_a_point_that_fails_is_named_or_recorded() -> None:
    study = Speeds(number=3, fails=2)
    with pytest.raises(StudyError, match=r"Point 2 of 3, .*failed with ValueError: as told"):
        study()
    found = study(on_error="record")
    assert [row.get("error", "") for row in found.rows] == ["", "ValueError: as told", ""]
    assert found.tables()["speeds"]["error"].values == ("", "ValueError: as told", "")
    assert math.isnan(found.column("largest")[1])
    assert json.loads(found.to_json())["tables"]["speeds"]["columns"]["largest"][1] is None
    lost = Speeds(number=1, fails=1)(on_error="record")
    assert list(lost.tables()["speeds"]) == ["angle", "side", "largest", "error"]
    assert math.isnan(lost.column("largest")[0])


@dataclass(frozen=True)
class Other(Speeds):
    """A study whose result has a column that it does not name."""

    columns: ClassVar = {"angle": "rad", "side": "", "speed": "rad/s"}


def test_columns_that_are_not_named_are_refused() -> None:
    with pytest.raises(StudyError, match=r"has the columns angle, side, speed, but .* have angle, side, largest"):
        Other(number=1)()


class Faulty(Speeds):
    """A study with a fault in its sentence and in its figure."""

    def text(self, found: object) -> str:
        return f"{None:.3g}"

    def draw(self, found: object) -> object:
        raise ZeroDivisionError("no width")


def test_a_fault_in_a_method_of_ones_own_is_said_with_its_name() -> None:
    found = Faulty(number=1)()
    with pytest.raises(StudyError, match="The method text of the study speeds failed with TypeError: unsupported"):
        _ = found.text
    with pytest.raises(StudyError, match="The method draw of the study speeds failed with ZeroDivisionError: no width"):
        found.plot()


def test_a_class_that_is_no_study_is_refused_with_the_remedy() -> None:
    class Empty(Study):
        """Nothing."""

    class Plain(Study):
        """Not a dataclass."""

        name = "plain"
        columns: ClassVar = {"a": ""}
        points = run = lambda self, *_: []

    @dataclass(frozen=True)
    class Away(Speeds):
        """A name that is a path."""

        name = "../away"

    @dataclass(frozen=True)
    class Taken(Speeds):
        """A setting that is an option of every command."""

        out: int = 3

    for kind, said in ((Empty, "lacks name, columns, points, run, which its class must define"), (Plain, "@dataclass"),
                       (Away, "letters, digits, - and _, not '../away'")):
        with pytest.raises(SceneError, match=re.escape(said)):
            kind()()
    with pytest.raises(SceneError, match="A setting of the study speeds cannot be called out"):
        run_command(Taken)


@pytest.mark.parametrize(("settings", "said"), [
    ({"number": 0}, "number must be a whole number from 1 to 1000, not 0"),
    ({"most": -1.0}, "most must be"), ({"integrator": "rk5"}, "rk4"),
])
def test_settings_are_checked(settings: dict[str, object], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        Speeds(**settings)


@pytest.fixture
def command(monkeypatch, tmp_path, capsys):
    """Run the command of the study in a folder of the test; return its code and what it printed."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str, kind: type[Study] = Speeds) -> tuple[object, str, str]:
        monkeypatch.setattr(sys, "argv", ["speeds", *words])
        with pytest.raises(SystemExit) as end:
            run_command(kind)
        printed = capsys.readouterr()
        return end.value.code or 0, printed.out, printed.err

    return run


@pytest.mark.slow
def test_its_command_has_an_option_for_each_setting(command, tmp_path: Path) -> None:
    code, printed, _ = command("--number", "3", "--most", "90", "--both", "--svg")
    assert code == 0
    assert "Wrote 3 files to out/speeds: speeds.png, speeds.svg, speeds.csv" in printed
    assert "The largest of all is" in printed
    rows = rows_of(tmp_path / "out" / "speeds" / "speeds.csv")
    check(rows)
    assert [float(row["angle"]) for row in rows] == pytest.approx([math.pi / 6, math.pi / 3, math.pi / 2] * 2)
    code, printed, _ = command("--help")
    text = " ".join(printed.replace("│", " ").split())
    for words in ("Largest velocity of a swing without losses.", "largest release angle, in degrees; by default 114.6.",
                  "the method: rk4, velocity_verlet; by default rk4.", "--both", "The files are written to out/speeds"):
        assert words in text


def test_its_command_resumes_and_records(command, tmp_path: Path) -> None:
    code, _, said = command("--number", "3", "--fails", "2")
    assert code == 2
    assert "Point 2 of 3" in said
    assert len((tmp_path / "out" / "speeds" / "speeds.jsonl").read_text().splitlines()) == 3
    code, printed, _ = command("--number", "3", "--fails", "2", "--resume", "--record-errors")
    assert code == 0
    assert "ValueError: as told" in printed
    code, _, said = command("--number", "2", "--resume")
    assert code == 2
    assert "To begin again in this folder, leave --resume out." in said


@pytest.mark.parametrize(("words", "said"), [
    (("--number", "0"), "number must be a whole number from 1 to 1000, not 0"),
    (("--numbr", "3"), "No such option: --numbr (Possible options: --number"),
    (("--most", "wide"), "'wide' is not a number"),
])
def test_its_command_says_what_is_wrong(command, tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    code, printed, error = command(*words)
    assert (code, printed) == (2, "")
    assert said in " ".join(error.split())
    assert not list(tmp_path.iterdir())


def test_the_name_is_public() -> None:
    assert pendulum_env.Study is Study
