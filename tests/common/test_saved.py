"""Results as files: every class comes back bit by bit, NumPy and JSON read them alone, what is unsafe is refused.

What stands in a file is compared with what ``zipfile``, ``json`` and ``numpy.load`` read, which share nothing with
:mod:`pendulum_env.common.saved`.
"""

from __future__ import annotations

import errno
import io
import json
import math
import random
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from small_driven_fit import small_driven_fit
from small_results import OWN, PYTHON, SMALL, small, swing

import integrators
import pendulum_env
from pendulum_env import SCENES, Recording, SceneError, audit, fit, load, rollout, simplify, sweep
from pendulum_env.common import saved
from pendulum_env.common.provenance import OutputError
from pendulum_env.common.saved import CLASSES, MODULES, origin_of
from pendulum_env.common.version import sources
from pendulum_env.envs.transfer import Transfer
from pendulum_env.hard_cases.case import Case, Finding
from pendulum_env.hard_cases.run import Matrix, MatrixEntry
from pendulum_env.notebook import CARDS, FIGURES
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.presets import find_scene

pytestmark = pytest.mark.usefixtures("all_interpreted")

HERE = Path(__file__).parent
NO_RESULTS = {"Scene", "LabPendulumEnv", "LabPendulumVectorEnv", "Filmed", "Result", "StudyResult"}
"""Cards of what is no result of its own: a scene has its own file, a film is one, a study is kept as a sweep."""


def save(result: Any, path: Path) -> Path:
    return result.save(path) if hasattr(result, "save") else saved.save(result, path)


def bits(x: float) -> bytes:
    return struct.pack("<d", x)


def same(one: Any, other: Any) -> bool:
    """True if two values are of the same types, and all their numbers of the same bits."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and (
            all(map(same, one.flat, other.flat)) if one.dtype == object else one.tobytes() == other.tobytes())
    if isinstance(one, integrators.Method) or (callable(one) and not is_dataclass(one)):
        return one is other
    if is_dataclass(one):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, dict):
        return len(one) == len(other) and all(map(same, one, other)) and all(map(same, one.values(), other.values()))
    if isinstance(one, (tuple, list)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, (float, np.generic)):
        return np.array(one).tobytes() == np.array(other).tobytes()
    return bool(one == other)


def agrees(node: Any, value: Any, file: Any, seen: set[str]) -> None:
    """AssertionError unless a part of the JSON text, with the arrays that ``numpy.load`` gives, is a value."""
    if isinstance(node, list):
        assert type(value) is list
        for part, own in zip(node, value, strict=True):
            agrees(part, own, file, seen)
    elif not isinstance(node, dict):
        assert type(node) is type(value)
        assert node == value
        if isinstance(node, float):
            assert bits(node) == bits(value)
    elif "$array" in node:
        array = file[node["$array"].removesuffix(".npy")]
        seen.add(node["$array"])
        assert (array.dtype.str, list(array.shape)) == (node["dtype"], node["shape"])
        assert array.tobytes() == value.tobytes()
    elif "$tuple" in node:
        assert type(value) is tuple
        agrees(node["$tuple"], list(value), file, seen)
    elif "$objects" in node:
        assert list(value.shape) == node["shape"]
        agrees(node["$objects"], list(value.flat), file, seen)
    elif "$class" in node:
        assert node["$class"] == type(value).__name__
        for name, part in node.items():
            if name != "$class":
                agrees(part, getattr(value, name), file, seen)
    elif "$scene" in node:
        assert node["$scene"] == json.loads(json.dumps(value.to_dict()))
    elif "$method" in node:
        assert node["$method"] == value.name
    elif "$float" in node:
        assert math.isnan(value) if "nan" in node["$float"] else value == float(node["$float"])
    elif "$number" in node:
        assert node["dtype"] == value.dtype.str
        assert node["$number"] == value
    elif "$frozenset" in node:
        assert set(node["$frozenset"]) == value
    elif "$same" not in node:
        assert set(node) == set(value)
        for name, part in node.items():
            agrees(part, value[name], file, seen)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """Small results as files, each written when it is first asked for."""
    folder = tmp_path_factory.mktemp("saved")

    class Files(dict):  # type: ignore[type-arg]
        def __missing__(self, name: str) -> Path:
            self[name] = save(small(name), folder / f"{name}.zip")
            return self[name]

    return Files()


# --- every result -----------------------------------------------------------------------------------------------------


def test_every_card_and_every_class_of_a_file_is_tested(files: Mapping[str, Path]) -> None:
    assert set(CARDS) - NO_RESULTS <= set(SMALL)
    met = set()
    for name in SMALL:
        with zipfile.ZipFile(files[name]) as archive:
            text = archive.read("result.json").decode()
            met |= {kind for kind in MODULES if f'"$class": "{kind}"' in text}
    assert met == set(MODULES)
    assert len(MODULES) == sum(map(len, CLASSES.values()))


@pytest.mark.parametrize("name", SMALL)
def test_a_result_comes_back_bit_by_bit(name: str, files: Mapping[str, Path]) -> None:
    result, loaded = small(name), load(files[name])
    assert same(loaded, result)
    assert repr(loaded) == repr(result)
    for attribute in dir(type(result)):
        if isinstance(getattr(type(result), attribute), property) and not attribute.startswith("_"):
            outcome, again = (attempt(one, attribute) for one in (result, loaded))
            assert same(again, outcome), attribute


def attempt(result: Any, attribute: str) -> Any:
    """The value of a property, or the text of its error."""
    try:
        with np.errstate(all="ignore"):
            return getattr(result, attribute)
    except (ValueError, ArithmeticError, AttributeError, KeyError) as error:
        return str(error)


@pytest.mark.parametrize("name", SMALL)
def test_numpy_and_json_read_a_file_without_the_package(name: str, files: Mapping[str, Path]) -> None:
    with np.load(files[name]) as file, zipfile.ZipFile(files[name]) as archive:
        def refused(text: str) -> None:
            raise AssertionError(f"{text} is no JSON")

        whole = json.loads(archive.read("result.json"), parse_constant=refused)
        seen: set[str] = set()
        agrees(whole["result"], small(name), file, seen)
        assert {*seen, "result.json"} == set(archive.namelist())
        assert archive.testzip() is None
        assert (whole["format"], whole["version"]) == ("lab-pendulum result", 1)
        assert whole["provenance"]["Sources"] == sources()


def test_arrays_are_called_by_their_places(files: Mapping[str, Path]) -> None:
    with np.load(files["Rollout"]) as file:
        assert {"time", "angle", "ledger.kinetic", "heat_by_effect.linear_drag", "watched.tension", "t_events.0"
                } <= set(file)
    with np.load(files["Fit"]) as file:  # the recording of all fits is there once
        assert [name for name in file if name.endswith("recording.angle")] == ["recording.angle"]
    with np.load(files["batch"]) as file:
        assert file["t_events.0.3"].shape == small("batch").t_events[0][1, 1].shape


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Rollout", *(pytest.param(name, marks=pytest.mark.slow) for name in (
    "Growth", "Matrix", "Section", "Basins", "Recording", "Comparison", "LabSheet", "Audit", "Simplification"))])
def test_figures_and_cards_of_a_loaded_result_are_those_of_the_result(name: str, files: Mapping[str, Path]) -> None:
    assert name in FIGURES
    both = small(name), load(files[name])
    assert both[0].plot().as_html() == both[1].plot().as_html()
    assert both[0]._repr_html_() == both[1]._repr_html_()


def test_dense_output_and_events_stay(files: Mapping[str, Path]) -> None:
    run, loaded = small("Rollout"), load(files["Rollout"])
    times = np.linspace(0.0, 0.5, 77)
    assert same(loaded(times), run(times))
    assert same(loaded.t_events, run.t_events)
    assert loaded.t_events[0].tolist() == [0.125]


def test_objects_that_are_one_stay_one(files: Mapping[str, Path]) -> None:
    """The table of a matrix finds a case's entries by it."""
    matrix = load(files["Matrix"])
    assert all(entry.case is matrix.cases[0] for entry in matrix.entries)
    found = load(files["Fit"])
    assert found.comparison.best.recording is found.recording
    assert found.comparison.best.model.time is found.model.time


def test_an_array_that_stands_twice_is_written_once(tmp_path: Path) -> None:
    both = np.arange(3.0)
    path = Transfer(both, both, ()).save(tmp_path / "one.zip")
    assert {*members(path)} == {"result.json", "nominal.npy"}
    loaded = load(path)
    assert loaded.real is loaded.nominal


@pytest.mark.slow
@pytest.mark.parametrize("make", [
    lambda: fit(swing(), mass=0.1), lambda: small_driven_fit("log"),
    lambda: audit("lab", amplitude=0.3, tolerance=1e-2),
    lambda: simplify("lab", amplitude=0.3, tolerance=1e-2), lambda: small_fit().bootstrap(5),
    lambda: rollout("windy", angle=np.linspace(0.1, 3.0, 1000), duration=10.0)])
def test_measured_results_come_back_bit_by_bit(make: Callable[[], Any], tmp_path: Path,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("LAB_PENDULUM_BACKEND")
    result = make()
    assert same(load(save(result, tmp_path / "one.zip")), result)


def small_fit() -> Any:
    return fit(swing(), "linear", mass=0.1)


# --- values -----------------------------------------------------------------------------------------------------------

SCALARS = st.one_of(st.none(), st.booleans(), st.integers(-2**70, 2**70), st.floats(), st.text(max_size=5),
                    st.floats().map(np.float64), st.integers(-9, 9).map(np.int32), st.booleans().map(np.bool_),
                    st.sampled_from(["", "a", "ä b"]).map(np.str_),
                    st.floats(width=32).map(np.float32))
ARRAYS = arrays.arrays(st.sampled_from(["<f8", "<f4", ">f8", "<i8", "u1", "?", "<c16", "<U3"]),
                       arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3))
KEYS = st.one_of(st.text(max_size=4), st.sampled_from(["$class", "a/b", "a_b", "", "..", "$"]), st.integers(0, 3))
VALUES = st.recursive(st.one_of(SCALARS, ARRAYS), lambda inner: st.one_of(
    st.lists(inner, max_size=3), st.lists(inner, max_size=3).map(tuple), st.dictionaries(KEYS, inner, max_size=3),
    st.frozensets(st.text(max_size=3), max_size=3)), max_leaves=8)


@pytest.mark.slow
@given(VALUES)
@settings(max_examples=25)
def test_nested_values_come_back_bit_by_bit(tmp_path_factory: pytest.TempPathFactory, value: Any) -> None:
    path = tmp_path_factory.getbasetemp() / "nested.zip"
    Transfer(value, np.zeros(2), ()).save(path)
    assert same(load(path).nominal, value)


@pytest.mark.parametrize("value", [
    np.arange(12.0).reshape(3, 4).T, np.arange(12.0)[::2], np.array(5.0), np.zeros((0, 3)), np.array(["ä", "b"]),
    np.array([1.0, math.nan, -0.0, 5e-324, -math.inf]), np.array([np.arange(2.0), None], dtype=object),
    np.array(["2026-01-01"], dtype="M8[D]"), -math.nan, struct.unpack("<d", b"\x01" + bytes(5) + b"\xf4\x7f")[0],
    np.array(0x7F800001, "u4").view("f4")[()]], ids=str)
def test_arrays_of_every_layout_and_every_nan(value: Any, tmp_path: Path) -> None:
    assert same(load(Transfer(value, value, ()).save(tmp_path / "one.zip")).real, value)


def test_every_method_is_known_by_its_numbers(tmp_path: Path) -> None:
    prints = {saved.fingerprint(method) for method in integrators.METHODS.values()}
    assert len(prints) == len(integrators.METHODS)
    other = integrators.RungeKutta(name="rk4", order=1, source="a book", summary="Euler's", a=((0,),), b=(1,))
    all_three = integrators.get("rk4"), other, integrators.get("taylor7")
    path = Transfer(all_three, np.zeros(2), ()).save(tmp_path / "one.zip")
    with pytest.raises(SceneError, match=r"'rk4' is not of the package; give it, as in load\(path, methods=\[mine\]\)"):
        load(path)
    with pytest.raises(SceneError, match=r"'rk4' is not of the package; the one in methods= has other numbers"):
        load(path, methods=[integrators.get("rk4")])
    assert load(path, methods=[other]).nominal == all_three


def test_a_method_that_has_changed_since_is_told(tmp_path: Path, files: Mapping[str, Path]) -> None:
    path = changed(files["slack"], tmp_path, lambda whole: whole["result"]["method"].update(fingerprint="0" * 16))
    with pytest.warns(UserWarning, match="the method rk4 had other numbers when this was computed"):
        assert load(path).method is integrators.get("rk4")


def test_a_method_of_ones_own(tmp_path: Path) -> None:
    run = rollout("vacuum", integrator=OWN, angle=1.0, **PYTHON)
    assert run.save(tmp_path / "one.zip")
    with pytest.raises(SceneError, match=r"'mine/\.\./of two stages' is not of the package"):
        load(tmp_path / "one.zip")
    assert same(load(tmp_path / "one.zip", methods=[OWN]), run)
    step = integrators.from_step(lambda theta, omega, dt, a: (theta + omega * dt, omega + a(theta, omega) * dt))
    path = rollout("vacuum", integrator=step, angle=1.0, **PYTHON).save(tmp_path / "step.zip")
    assert load(path, methods=[step]).method is step


@dataclass(frozen=True)
class Cubic(Effect):
    """Cubic drag, of one's own."""

    strength: float = 0.1

    name = "cubic"
    kind = "dissipative"

    def coefficients(self, scene: Any) -> Mapping[str, float]:
        """Return the strength per inertia."""
        return {"cubic": self.strength / scene.inertia}


Cubic.torque = staticmethod(lambda velocity, cubic: -cubic * velocity * velocity * velocity)  # type: ignore[method-assign]


def test_an_effect_of_ones_own(tmp_path: Path) -> None:
    scene = SCENES["vacuum"].with_effects([*SCENES["vacuum"].effects, Cubic(0.25)])
    path = Transfer(scene, np.zeros(2), ()).save(tmp_path / "one.zip")
    with pytest.raises(SceneError, match=r"'cubic' is not of the package; give its class, as in load\(path, effects"):
        load(path)
    assert load(path, effects=[Cubic]).nominal == scene

    class LinearDrag(type(SCENES["lab"].effects[2])):  # type: ignore[misc]
        """One's own of a name that the package has, which does not stand in for it."""

    mine = SCENES["lab"].with_effects([LinearDrag(**vars(one)) if one.name == "linear_drag" else one
                                       for one in SCENES["lab"].effects])
    path = Transfer(mine, np.zeros(2), ()).save(tmp_path / "two.zip")
    with pytest.raises(SceneError, match="'linear_drag' is not of the package"):
        load(path)
    assert load(path, effects=[LinearDrag]).nominal == mine
    assert load(small("Rollout").save(tmp_path / "three.zip"), effects=[LinearDrag]).scene == small("Rollout").scene


def test_a_hard_case_that_is_no_longer_there_keeps_its_data(tmp_path: Path) -> None:
    known = small("Matrix").cases[0]
    case = Case("gone", known.group, "why", "truth", "source", known.scene, known.may, known.attempt)
    entry = MatrixEntry(case, integrators.get("rk4"), Finding("accurate", 1e-3), True)
    loaded = load(Matrix((case,), (entry.method,), (entry,)).save(tmp_path / "one.zip"))
    assert loaded.entries[0].case is loaded.cases[0]
    assert loaded.entries[0].method is loaded.methods[0]
    assert loaded.cases[0].name == "gone"
    assert same(loaded.entries[0].finding, entry.finding)
    assert loaded.table.rows[0][1] == "gone"
    with pytest.raises(SceneError, match="hard case 'gone' is no longer in the catalogue"):
        loaded.cases[0].may(entry.method)


def test_a_sweep_that_stands_in_a_file_is_saved_too(tmp_path: Path) -> None:
    found = sweep({"a": [1, 2]}, run=lambda point: {"b": point["a"] / 3}, file=tmp_path / "s.jsonl", in_memory=False,
                  name="thirds")
    assert load(found.save(tmp_path / "one.zip")).rows == found.rows == ({"a": 1, "b": 1 / 3}, {"a": 2, "b": 2 / 3})


# --- where a result comes from ----------------------------------------------------------------------------------------


def test_a_file_says_what_computed_the_result_and_so_do_files_that_it_writes(
    tmp_path: Path, files: Mapping[str, Path],
) -> None:
    facts = origin_of(files["Growth"])
    assert facts == origin_of(str(files["Growth"])) == origin_of(small("Growth"))
    assert facts["Sources"] == sources()
    path = changed(files["Growth"], tmp_path, lambda whole: whole["provenance"].update(Sources="0123456789ab"))
    loaded = load(path)  # results are data: those that other sources computed are read
    assert same(loaded, small("Growth"))
    assert origin_of(loaded)["Sources"] == "0123456789ab"
    assert origin_of(loaded.save(tmp_path / "again.zip"))["Sources"] == "0123456789ab"
    assert json.loads(loaded.to_json())["provenance"]["Sources"] == "0123456789ab"
    assert loaded.to_pandas().attrs["provenance"]["Sources"] == "0123456789ab"
    assert loaded.to_xarray().attrs["Sources"] == "0123456789ab"


@pytest.mark.parametrize("name", ["comparison.zip", "rollout.npz"])
def test_files_of_the_first_version_are_read_for_good(name: str) -> None:
    """They stay as they are, whatever becomes of the package."""
    path = HERE / "version_1" / name
    loaded = load(path)
    with np.load(path) as file, zipfile.ZipFile(path) as archive:
        agrees(json.loads(archive.read("result.json"))["result"], loaded, file, set())
    run = loaded if name == "rollout.npz" else loaded.runs["rk4"]
    assert run.angle[-1] == {"rollout.npz": ROLLOUT_END, "comparison.zip": COMPARISON_END}[name]
    assert origin_of(path)["Software"] == "lab-pendulum 0.1.0"
    assert run.scene.name == {"rollout.npz": "lab", "comparison.zip": "vacuum"}[name]
    if name == "rollout.npz":
        assert run(0.1)[0] == run.angle[5]
    else:
        assert loaded.plot()


ROLLOUT_END = 0.5588837977129449
COMPARISON_END = 0.6916685297587815


# --- what is not written ----------------------------------------------------------------------------------------------


class Mine:
    pass


@pytest.mark.parametrize(("value", "said"), [
    (lambda x: x, "cannot keep nominal.0.of, <function"),
    (Mine(), "cannot keep nominal.0.of, .*: it is of the type Mine"),
    (3j, "the type complex"), (b"1", "the type bytes"), (Path("x"), "Path"), (np.longdouble(1), "longdouble"),
    (np.zeros(2, "f8,f8"), "an array of the type"), (np.ma.zeros(2), "the type MaskedArray"),
    (np.array([Mine()], dtype=object), "nominal.0.of.0, "),
])
def test_what_no_file_can_keep_is_refused_before_one_is_written(value: Any, said: str, tmp_path: Path) -> None:
    kept = tmp_path / "one.zip"
    kept.write_text("kept")
    with pytest.raises(SceneError, match=said):
        Transfer([{"of": value}], np.zeros(2), ()).save(kept)
    with pytest.raises(SceneError, match=said):
        Transfer([{"of": value}], np.zeros(2), ()).save(tmp_path / "new" / "one.zip")
    assert [path.name for path in tmp_path.iterdir()] == ["one.zip"]
    assert kept.read_text() == "kept"


def test_a_body_of_ones_own_is_refused(tmp_path: Path) -> None:
    @dataclass(frozen=True)
    class Ball(type(SCENES["lab"].body)):  # type: ignore[misc]
        shape = "my ball"

    body = Ball(**{f.name: getattr(SCENES["vacuum"].body, f.name) for f in fields(SCENES["vacuum"].body)})
    with pytest.raises(SceneError, match="cannot keep the scene 'vacuum': its dict"):
        Transfer(SCENES["vacuum"].replace(body=body), np.zeros(2), ()).save(tmp_path / "one.zip")


def test_a_result_that_holds_itself_or_an_endless_number_is_refused(tmp_path: Path) -> None:
    round_: list[Any] = []
    round_.append(round_)
    for value in (round_, 10**5000):
        with pytest.raises(SceneError, match="A file cannot keep the Transfer: "):
            Transfer(value, np.zeros(2), ()).save(tmp_path / "one.zip")


def test_a_class_that_only_has_a_known_name_is_refused(tmp_path: Path) -> None:
    @dataclass
    class Law:
        kind: str = "mine"

    with pytest.raises(SceneError, match="cannot keep nominal: its class is not the package's Law"):
        Transfer(Law(), np.zeros(2), ()).save(tmp_path / "one.zip")


def test_names_without_an_ending_and_other_objects_are_refused(tmp_path: Path) -> None:
    for name in ("run", "run.csv", "run.json", "run.pkl"):
        with pytest.raises(SceneError, match=rf"ends in \.zip or \.npz, not as '{name}'"):
            swing().save(tmp_path / name)
    for other in (3, SCENES["lab"], {"a": 1}, rollout):
        with pytest.raises(SceneError, match="save writes a result"):
            saved.save(other, tmp_path / "one.zip")
    assert not list(tmp_path.iterdir())
    assert swing().save(tmp_path / "of" / "RUN.ZIP").is_file()


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left on device")])
def test_ctrl_c_and_a_full_disk_leave_the_former_file(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = small("slack").save(tmp_path / "one.zip")
    before, count = path.read_bytes(), iter([None, None, error])

    def write(*given: Any, **more: Any) -> None:
        if (stop := next(count)) is not None:
            raise stop

    monkeypatch.setattr(np.lib.format, "write_array", write)
    with pytest.raises((KeyboardInterrupt, OutputError), match=r"^$|cannot be written: No space left on device\."):
        small("batch").save(path)
    assert next(count, "none left") == "none left"
    assert [one.name for one in tmp_path.iterdir()] == ["one.zip"]
    assert path.read_bytes() == before


def test_equal_results_are_equal_files_and_zeros_take_no_room(tmp_path: Path) -> None:
    files = [small("slack").save(tmp_path / f"{i}.zip").read_bytes() for i in range(2)]
    assert files[0] == files[1]
    noise = np.random.default_rng(0).random(20_000)
    path = Transfer(np.zeros(20_000), noise, ()).save(tmp_path / "one.zip")
    with zipfile.ZipFile(path) as archive:
        stored = {info.filename: info for info in archive.infolist()}
    assert stored["nominal.npy"].compress_size < 2000
    assert stored["real.npy"].compress_type == zipfile.ZIP_STORED  # that compression hardly shortens


def test_a_large_result_of_zeros_can_be_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is stored as it is, because a file that unpacks to very much more than its size is refused."""
    monkeypatch.setattr(saved, "MOST", 2**16)
    path = Transfer(np.zeros(2**20), np.zeros(2), ()).save(tmp_path / "one.zip")
    assert path.stat().st_size > 2**23
    assert load(path).nominal.shape == (2**20,)


# --- what is not read -------------------------------------------------------------------------------------------------


def members(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(path: Path, files: Mapping[str, bytes], how: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", how) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


def changed(path: Path, folder: Path, change: Callable[[Any], Any]) -> Path:
    """A copy of a file whose JSON text is changed."""
    files = members(path)
    whole = json.loads(files["result.json"])
    change(whole)
    return packed(folder / "changed.zip", {**files, "result.json": json.dumps(whole).encode()})


def npy(array: Any) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def replaced(**files: Any) -> Callable[[Path, Path], Path]:
    """A change of members: an array or bytes in place of one, or None to leave it out."""
    def change(path: Path, folder: Path) -> Path:
        own = members(path)
        for name, data in files.items():
            own[name] = data if isinstance(data, (bytes, type(None))) else npy(data)
        return packed(folder / "one.zip", {name: data for name, data in own.items() if data is not None})

    return change


def edited(change: Callable[[Any], Any]) -> Callable[[Path, Path], Path]:
    return lambda path, folder: changed(path, folder, change)


def result(**parts: Any) -> Callable[[Path, Path], Path]:
    return edited(lambda whole: whole["result"].update(parts))


def other(text: bytes) -> Callable[[Path, Path], Path]:
    def write(path: Path, folder: Path) -> Path:
        (folder / "other.zip").write_bytes(text)
        return folder / "other.zip"

    return write


ANGLE = {"$array": "angle.npy", "dtype": "<f8", "shape": [51]}
REFUSED: Mapping[str, tuple[Callable[[Path, Path], Path], str]] = {
    "text": (other(b"angle, velocity\n1, 2\n"), "not a file that save wrote, or is damaged: File is not a zip file"),
    "empty": (other(b""), "not a file that save wrote, or is damaged"),
    "a scene": (other(json.dumps(SCENES["lab"].to_dict()).encode()), "not a file that save wrote"),
    "other archive": (lambda path, folder: packed(folder / "o.zip", {"a.txt": b"a"}), "has no member result.json"),
    "not json": (replaced(**{"result.json": b"{"}), "not valid: JSONDecodeError"),
    "binary": (replaced(**{"result.json": b"\xff\xfe\x00"}), "not valid"),
    "a list": (replaced(**{"result.json": b"[]"}), "is not a file that save wrote"),
    "deep": (replaced(**{"result.json": b'{"format": ' + b"[" * 200_000}), "RecursionError|not valid"),
    "other format": (edited(lambda whole: whole.update(format="else")), "is not a file that save wrote"),
    "later": (edited(lambda whole: whole.update(version=2)),
              "has the version 2 of the format, and this package reads versions up to 1; install a newer lab-pendulum"),
    "no version": (edited(lambda whole: whole.pop("version")), "does not say the version"),
    "true": (edited(lambda whole: whole.update(version=True)), "does not say the version"),
    "no origin": (edited(lambda whole: whole.pop("provenance")), "does not say where the result comes from"),
    "no result": (edited(lambda whole: whole.pop("result")), "has no result"),
    "a number": (edited(lambda whole: whole.update(result=5)), "has no result"),
    "missing": (replaced(**{"angle.npy": None}), "member 'angle.npy' is missing"),
    "class": (result(**{"$class": "Rollouts"}), "the unknown class 'Rollouts'; did you mean Rollout"),
    "evil class": (result(ledger={"$class": "Popen", "args": ["touch", "x"]}), "the unknown class 'Popen'"),
    "field": (result(angel=1), "a Rollout has no field 'angel'; did you mean angle"),
    "no field": (edited(lambda whole: whole["result"].pop("velocity")), "a Rollout lacks the field velocity"),
    "kind": (result(angle={"$pickle": "angle"}), r"angle is of the unknown kind '\$pickle'"),
    "method": (result(method={"$method": "rk5000", "fingerprint": "0"}), "no method 'rk5000' in this version"),
    "effect": (edited(lambda whole: whole["result"]["scene"]["$scene"]["effects"][0].update(effect="glue")),
               "There is no effect 'glue'"),
    "scene": (edited(lambda whole: whole["result"]["scene"]["$scene"]["body"].update(mass=-1)), "mass must be"),
    "same": (result(dt={"$same": "nowhere"}), "dt names 'nowhere', which does not stand before it"),
    "shape": (replaced(**{"angle.npy": np.zeros(52)}), r"shape \(52,\), not of float64 of shape \(51,\) as declared"),
    "type": (replaced(**{"angle.npy": np.zeros(51, "f4")}), "an array of float32 of shape"),
    "objects": (result(angle={**ANGLE, "dtype": "|O"}), r"the unknown type of numbers '\|O'"),
    "code": (result(angle={**ANGLE, "dtype": "exit(5)"}), r"the unknown type of numbers 'exit\(5\)'"),
    "number": (result(dt={"$number": 1, "dtype": "O"}), "the unknown type of numbers 'O'"),
    "pickle": (replaced(**{"angle.npy": npy(np.array([Path("x")] * 51, dtype=object))}), "an array of object"),
    "short": (lambda path, folder: replaced(**{"angle.npy": members(path)["angle.npy"][:-8]})(path, folder),
              "has 400 bytes, not those of an array of float64"),
    "long": (lambda path, folder: replaced(**{"angle.npy": members(path)["angle.npy"] + b"1"})(path, folder),
             "has 409 bytes"),
    "no array": (replaced(**{"angle.npy": b"x"}), "not valid"),
    "path": (replaced(**{"../angle.npy": b"x"}), r"member '\.\./angle\.npy' is unsafe"),
    "absolute": (replaced(**{"/etc/passwd": b"x"}), "member '/etc/passwd' is unsafe"),
    "drive": (replaced(**{"C:\\x": b"x"}), "is unsafe"),
    "folder": (replaced(**{"a/b": b"x"}), "is unsafe"),
    "hidden": (replaced(**{".profile": b"x"}), "is unsafe"),
}
"""Damage -> function that makes a damaged copy of a rollout's file, and what is said of it."""


@pytest.mark.parametrize("damage", REFUSED)
def test_damaged_and_unsafe_files_are_refused(damage: str, files: Mapping[str, Path], tmp_path: Path) -> None:
    make, said = REFUSED[damage]
    path = make(files["slack"], tmp_path)
    with pytest.raises(SceneError, match=said) as caught:
        load(path)
    assert str(caught.value).startswith(f"The file {path} cannot be read")
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith(".")


def test_two_members_of_one_name_are_refused(files: Mapping[str, Path], tmp_path: Path) -> None:
    path = Path(shutil.copy(files["slack"], tmp_path))
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("angle.npy", npy(np.zeros(51)))
    with pytest.raises(SceneError, match=r"member 'angle\.npy' is unsafe: a path, or there twice"):
        load(path)


def test_bombs_are_refused_before_they_are_unpacked(
    files: Mapping[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = members(files["slack"])
    large = packed(tmp_path / "bomb.zip", {**own, "more.npy": bytes(2**24)})
    assert same(load(large), small("slack"))  # a member that the result does not name is left alone
    monkeypatch.setattr(saved, "MOST", 2**20)
    with pytest.raises(SceneError, match="is unsafe: unpacked, it would be over 200 times as large"):
        load(large)
    with pytest.raises(SceneError, match="is unsafe"):
        origin_of(large)
    claims = io.BytesIO()  # a header that claims an array larger than any memory
    np.lib.format.write_array_header_1_0(claims, {"descr": "<f8", "fortran_order": False, "shape": (2**58,)})
    path = changed(packed(tmp_path / "claim.zip", {**own, "angle.npy": claims.getvalue()}), tmp_path,
                   lambda whole: whole["result"]["angle"].update(shape=[2**58]))
    with pytest.raises(SceneError, match="has 0 bytes, not those of an array"):
        load(path)


def test_every_cut_and_every_changed_byte_is_refused_or_harmless(files: Mapping[str, Path], tmp_path: Path) -> None:
    """A changed byte of a date or an attribute in the archive changes no result."""
    data, source = files["slack"].read_bytes(), random.Random(5)
    path, refused = tmp_path / "one.zip", 0
    for _ in range(60):
        path.write_bytes(data[: source.randrange(len(data))])
        with pytest.raises(SceneError, match="cannot be read"):
            load(path)
    for _ in range(200):
        at = source.randrange(len(data))
        path.write_bytes(data[:at] + bytes([data[at] ^ (1 << source.randrange(8))]) + data[at + 1 :])
        try:
            found = load(path)
        except SceneError:
            refused += 1
        else:
            assert same(found, small("slack"))
    assert refused > 100


def test_files_that_are_not_there_are_said(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"none\.zip cannot be read: No such file or directory\."):
        load(tmp_path / "none.zip")
    with pytest.raises(SceneError, match="Is a directory"):
        load(tmp_path)
    with pytest.raises(SceneError, match="No such file"):
        origin_of(tmp_path / "none.zip")


def test_methods_and_effects_are_checked(files: Mapping[str, Path]) -> None:
    for wrong in ("rk4", ["rk4"], [3], 5):
        with pytest.raises(SceneError, match="methods must be"):
            load(files["slack"], methods=wrong)
    for wrong in ("gravity", [Cubic()], [int], 5):
        with pytest.raises(SceneError, match="effects must be"):
            load(files["slack"], effects=wrong)


# --- how light it is --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_recording_is_loaded_without_compilers_and_figures(files: Mapping[str, Path]) -> None:
    code = ("import sys, pendulum_env\n"
            f"print(repr(pendulum_env.load({str(files['Recording'])!r})))\n"
            "print([name for name in ('numba', 'matplotlib', 'pygame') if name in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [repr(swing()), "[]"]


def test_load_is_a_public_name() -> None:
    assert "load" in pendulum_env.__all__
    assert pendulum_env.load is load
    assert isinstance(load(HERE / "version_1" / "rollout.npz").scene, type(find_scene("lab")))
    assert Recording.save is saved.Savable.save
