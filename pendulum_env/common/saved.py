"""Results as files: a zip archive with one JSON text and one array of NumPy for every array, for good.

The member ``result.json`` has the keys "format" and "version" of the file, "provenance", and "result": an object
``{"$class": name, field: value, ...}``. Numbers, texts, true, false, null and lists are those of JSON, and so is a dict
whose keys are texts that do not begin with "$". Every other value is an object with one of these keys:

| key | the value |
| --- | --- |
| `$class` | an instance of the class of this name; the other keys are its fields |
| `$array` | the array in a member, such as `ledger.kinetic.npy` for the field `kinetic` of `ledger`; "dtype", "shape" |
| `$tuple`, `$frozenset` | a tuple or a frozenset, as a list |
| `$objects` | an array of other values, as a list; "shape" |
| `$dict` | a dict with other keys, as a list of pairs |
| `$float` | "nan", "-nan", "inf", "-inf", or another nan as the 16 hexadecimal digits of its bits |
| `$number` | a number or a text of NumPy; "dtype" |
| `$scene` | a scene, as `Scene.to_dict` returns it; "own": names of its effects that are not of the package |
| `$method` | a method's name; "fingerprint" of its numbers; "own": true for one that is not of the package |
| `$same` | the object that stands further up, at a place such as `cases.3` |

Every member can be read without this package, by ``json`` and ``numpy.load``. Nothing in a file is ever run: there are
no pickles, and the classes are those of CLASSES.
"""

from __future__ import annotations

import json
import math
import re
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from hashlib import sha256
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import IO, Any

import numpy as np

from pendulum_env.common.checks import SceneError, file_path, nearest, several, shown, warn
from pendulum_env.common.provenance import output_folder, provenance
from pendulum_env.common.replacing import OutputError, replacing

__all__ = ["Savable", "load", "origin_of", "save"]

FORMAT, VERSION = "lab-pendulum result", 1
"""Name of the format of files, and its highest version that this package reads."""
ENDINGS = (".zip", ".npz")
"""Endings of the files' names."""
TEXT = "result.json"
"""Member of a file with everything but the arrays."""
MEMBER = re.compile(r"[A-Za-z0-9_+-][A-Za-z0-9_.+-]*")
"""Names of members: no paths, and nothing that an operating system could read as one."""
DTYPE = re.compile(r"[<>|][biufcUSmM]\d+(\[\d*[A-Za-z]+\])?")
"""Names of NumPy's types of numbers, texts and times, such as ``<f8``."""
LONGEST = 150
"""Largest number of characters of a member's name."""
MOST, RATIO = 2**28, 200
"""A file's members may have MOST bytes, or RATIO times as many as the file."""
SAMPLE, WORTH = 2**16, 0.9
"""A member is compressed if that makes its first SAMPLE bytes shorter than this share of them."""
KEPT = "origin in the file"
"""Entry of a loaded result's ``vars`` for its provenance."""

CLASSES: Mapping[str, tuple[str, ...]] = {
    "pendulum_env.controllers.policy": ("Policy",),
    "pendulum_env.engine.result": ("Rollout",),
    "pendulum_env.physics.energy": ("Ledger",),
    "integrators.solving.dense": ("DenseOutput", "Curve"),
    "pendulum_env.truth.answer": ("Truth",),
    "pendulum_env.auto.choice": ("Ranking",),
    "pendulum_env.auto.calibrate": ("Choice",),
    "pendulum_env.auto.search": ("Candidate",),
    "pendulum_env.envs.transfer": ("Transfer", "Difference"),
    "pendulum_env.hard_cases.run": ("Matrix", "MatrixEntry"),
    "pendulum_env.hard_cases.case": ("Bound", "Case", "Finding"),
    "pendulum_env.lab.amplitudes": ("AmplitudeSheet", "Envelope"),
    "pendulum_env.lab.inertial": ("Mount",),
    "pendulum_env.lab.gates": ("GateSheet",),
    "pendulum_env.lab.kater": ("KaterSheet",),
    "pendulum_env.lab.lengths": ("LengthSheet",),
    "pendulum_env.lab.measures": ("Cycles", "Line", "Losses", "Measurement"),
    "pendulum_env.lab.recording": ("Recording",),
    "pendulum_env.lab.sheet": ("LabSheet",),
    "pendulum_env.lab.turning": ("TurningPoints",),
    "pendulum_env.lab.fitting.grade": ("Fault",),
    "pendulum_env.lab.fitting.intervals": ("Bootstrap",),
    "pendulum_env.lab.fitting.model": ("Model",),
    "pendulum_env.lab.fitting.posterior": ("Posterior",),
    "pendulum_env.lab.fitting.priors": ("Prior",),
    "pendulum_env.lab.fitting.remedies": ("Remedy",),
    "pendulum_env.lab.fitting.result": ("Fit", "FitComparison"),
    "pendulum_env.lab.fitting.shooting": ("FitSolution",),
    "pendulum_env.lab.driven.log": ("DrivenLog",),
    "pendulum_env.lab.driven.problem": ("DrivenSolution",),
    "pendulum_env.lab.driven.result": ("DrivenFit", "DrivenPrediction"),
    "pendulum_env.lab.driven.windows": ("Window", "Windows"),
    "pendulum_env.study.audit.verdicts": ("Audit", "AuditRow", "Simplification", "Simplified"),
    "pendulum_env.study.compare.comparison": ("Comparison",),
    "pendulum_env.study.compare.drift": ("Drift",),
    "pendulum_env.study.cost.points": ("CostPoint", "CostStudy"),
    "pendulum_env.study.growth_laws": ("Law",),
    "pendulum_env.study.growth": ("Growth", "GrowthLine"),
    "pendulum_env.study.basins": ("Basins",),
    "pendulum_env.study.section": ("Section",),
    "pendulum_env.study.stability": ("Stability",),
    "pendulum_env.study.sweep.study": ("Sweep",),
}
"""Module -> names of its classes that files may hold. Files have the names alone, so that a class may move."""
MODULES = {name: module for module, names in CLASSES.items() for name in names}


class Savable:
    """Base of results that can be written to a file."""

    def save(self, path: str | Path) -> Path:
        """Write the result with its origin as a file, which ``pendulum_env.load`` reads; return the path.

        The file's name ends in ``.zip`` or ``.npz``. It is a zip archive with one JSON text and one array of NumPy for
        every array; see :mod:`pendulum_env.common.saved`. Raises SceneError for another ending and for a result with
        contents that no file can keep, such as functions, and OutputError if the file cannot be written.
        """
        return save(self, path)


def save(result: Any, path: str | Path) -> Path:
    """Write a result of the package as a file, completely or not at all; see :meth:`Savable.save`.

    Raises SceneError for another object, another ending, and contents that no file can keep, OutputError if the file
    cannot be written.
    """
    place = file_path(path, "path")
    if place.suffix.lower() not in ENDINGS:
        raise SceneError(f"A result is saved as a zip archive, whose name ends in {' or '.join(ENDINGS)}, not as "
                         f"{shown(place.name)}.")
    if type(result).__name__ not in MODULES:
        raise SceneError(f"save writes a result, such as that of rollout or fit, not {shown(result)}.")
    writer = _Writer()
    try:
        whole = {"format": FORMAT, "version": VERSION, "provenance": dict(origin_of(result)),
                 "result": writer.value(result, "")}
        text = json.dumps(whole, allow_nan=False).encode()
    except SceneError:
        raise
    except (RecursionError, ValueError) as error:  # a list in itself, an integer of several thousand digits
        raise SceneError(f"A file cannot keep the {type(result).__name__}: {error}.") from None
    output_folder(place.parent)
    with replacing(place) as temporary:
        try:
            size = _pack(temporary, text, writer.members, zipfile.ZIP_DEFLATED)
            if _bomb(size, temporary.stat().st_size):
                _pack(temporary, text, writer.members, zipfile.ZIP_STORED)
        except OSError as error:
            raise OutputError(f"The file {place} cannot be written: {error.strerror or error}.") from None
    return place


def load(path: str | Path, *, methods: Iterable[Any] = (), effects: Iterable[type] = ()) -> Any:
    """Return the result in a file that its ``save`` wrote: a Rollout, a Fit, a Comparison, whatever it is.

    Arrays and numbers are the saved ones, bit for bit; nothing is simulated, and nothing in a file is run. A result is
    data, so that files that other sources of the package wrote are read, too: :func:`origin_of` says what computed
    them, and files that the loaded result writes say it again.

    Args:
        path: the file.
        methods: methods of your own that the file names.
        effects: classes of effects of your own that the file names.

    Warns if a method of the package has had other numbers since. Raises SceneError for a file that is damaged, unsafe
    or no such file, that a later version wrote, or that names a method or effect of its own that is not given.
    """
    place, given = file_path(path, "path"), several(methods, "methods", "methods")
    kind = import_module("integrators").Method
    for one in given:
        if not isinstance(one, kind):
            raise SceneError(f"methods must be instances of integrators.Method, not {shown(one)}.")
    own = several(effects, "effects", "classes of effects")
    for one in own:
        if not isinstance(one, type) or not isinstance(getattr(one, "name", None), str):
            raise SceneError(f"effects must be classes of effects, not {shown(one)}.")
    with _opened(place) as (archive, whole):
        reader = _Reader(archive, {one.name: one for one in given}, {one.name: one for one in own})
        result = reader.value(whole["result"], "")
        if type(result).__name__ not in MODULES:
            raise FileError("it has no result")
    if hasattr(result, "__dict__"):
        vars(result)[KEPT] = whole["provenance"]
    for name in reader.changed:
        warn(f"{place}: the method {name} had other numbers when this was computed; the result names today's.")
    return result


def origin_of(result: Any) -> dict[str, str]:
    """Return what a result comes from, or the result in a file at a path: version, digest of the sources, command, ...

    Raises SceneError for a path at which there is no file of a result.
    """
    if isinstance(result, (str, Path)):
        with _opened(file_path(result, "path")) as (_, whole):
            return dict(whole["provenance"])
    if hasattr(result, "__dict__") and KEPT in vars(result):
        return dict(vars(result)[KEPT])
    return dict(result.origin()) if hasattr(result, "origin") else provenance(Result=type(result).__name__)


# --- parts of places and members --------------------------------------------------------------------------------------


def _within(place: str, part: str) -> str:
    return f"{place}.{part}" if place else part


def _parts(keys: Iterable[Any]) -> list[str]:
    """Return the parts of places that stand for a dict's keys, none twice."""
    parts: dict[str, None] = {}
    for key in keys:
        part = re.sub(r"[^A-Za-z0-9_+-]", "_", str(key)) or "_"
        while part in parts:
            part += "_"
        parts[part] = None
    return [*parts]


def _bomb(size: int, packed: int) -> bool:
    """Return True if members of this size [bytes] are too large for a file of a size."""
    return size > max(MOST, RATIO * packed)


@cache
def _class_of(name: str) -> Any:
    return getattr(import_module(MODULES[name]), name)


@cache
def _field_names(name: str) -> dict[str, bool]:
    """Return the names of a class's fields, each with True if it must be given."""
    given = signature(_class_of(name)).parameters
    return {field: parameter.default is parameter.empty for field, parameter in given.items()}


def fingerprint(method: Any) -> str:
    """Return a digest of a method's numbers, without the texts that describe it."""
    bare = replace(method, source="", summary="", aliases=())
    return sha256(bare.fingerprint.encode()).hexdigest()[:16]


def _of_package(name: str) -> Any:
    """Return the package's method of a name, or None."""
    registry = import_module("integrators")
    try:
        return registry.get(name)
    except registry.MethodError:
        return None


# --- writing ----------------------------------------------------------------------------------------------------------


class _Writer:
    """Writes values as JSON; gathers their arrays as members of the file."""

    def __init__(self) -> None:
        self.members: dict[str, Any] = {}
        self._met: dict[int, tuple[Any, str]] = {}  # the values, too: an id may be used again
        self._arrays: dict[int, tuple[Any, str]] = {}
        self._method = import_module("integrators").Method

    def value(self, one: Any, place: str) -> Any:
        """Return what stands for a value in the JSON text."""
        kind = type(one)
        if one is None or kind in (bool, int, str):
            return one
        if kind is float:
            return one if math.isfinite(one) else {"$float": _unusual(one)}
        if kind is np.ndarray:
            return self._array(one, place)
        if kind is list:
            return self._all(one, place)
        if kind is tuple:
            return {"$tuple": self._all(one, place)}
        if isinstance(one, np.generic) and one.dtype.kind in "biufU" and kind is not np.longdouble:
            bare = one.item() if one == one else np.array(one)  # a nan's bits change on the way to another type
            return {"$number": self.value(bare, place), "dtype": one.dtype.str}
        if isinstance(one, self._method) or kind.__name__ in MODULES or kind.__name__ == "Scene":
            return self._object(one, place)
        if kind is frozenset:
            return {"$frozenset": self._all(sorted(one, key=repr), place)}
        if isinstance(one, Mapping):
            return self._dict(one, place)
        if isinstance(one, Sequence) and not isinstance(one, (tuple, str, bytes, bytearray)):  # such as a sweep's file
            return {"$tuple": self._all(one, place)}
        raise SceneError(f"A file cannot keep {place or 'the result'}, {shown(one)}: it is of the type "
                         f"{kind.__name__}, neither data nor a part of the package.")

    def _all(self, values: Iterable[Any], place: str) -> list[Any]:
        return [self.value(one, _within(place, str(i))) for i, one in enumerate(values)]

    def _dict(self, one: Mapping[Any, Any], place: str) -> dict[str, Any]:
        pairs = [(key, self.value(value, _within(place, part)))
                 for part, (key, value) in zip(_parts(one), one.items(), strict=True)]
        if all(type(key) is str and not key.startswith("$") for key in one):
            return dict(pairs)
        return {"$dict": [[self.value(key, place), value] for key, value in pairs]}

    def _array(self, one: Any, place: str) -> dict[str, Any]:
        if one.dtype == object:
            return {"$objects": self._all(one.flat, place), "shape": list(one.shape)}
        if one.dtype.kind not in "biufcUSmM":
            raise SceneError(f"A file cannot keep {place}, an array of the type {shown(one.dtype)}.")
        if id(one) not in self._arrays:
            stem, count = place[:LONGEST - 20], 1
            while f"{(name := stem if count == 1 else f'{stem}_{count}')}.npy" in self.members:
                count += 1
            self.members[f"{name}.npy"] = one
            self._arrays[id(one)] = one, f"{name}.npy"
        return {"$array": self._arrays[id(one)][1], "dtype": one.dtype.str, "shape": list(one.shape)}

    def _object(self, one: Any, place: str) -> dict[str, Any]:
        if id(one) in self._met:
            return {"$same": self._met[id(one)][1]}
        name = type(one).__name__
        if isinstance(one, self._method):
            of_package = _of_package(one.name)
            own = of_package is None or fingerprint(of_package) != fingerprint(one)
            written = {"$method": one.name, "fingerprint": fingerprint(one), **({"own": True} if own else {})}
        elif name == "Scene":
            written = _scene_data(one)
        elif type(one) is not _class_of(name):
            raise SceneError(f"A file cannot keep {place or 'the result'}: its class is not the package's {name}.")
        else:
            values = {field: getattr(one, field) for field in _field_names(name)}
            if name == "Case":  # its functions are those of the catalogue
                values = {field: value for field, value in values.items() if not callable(value)}
            written = {"$class": name, **{field: self.value(value, _within(place, field))
                                          for field, value in values.items()}}
        self._met[id(one)] = one, place
        return written


def _unusual(one: float) -> str:
    """Return the text for a number that is not finite."""
    text = repr(math.copysign(1.0, one))[:-3] + repr(abs(one)) if math.isnan(one) else repr(one)
    bits = struct.pack(">d", one)
    return text if struct.pack(">d", float(text)) == bits else bits.hex()


def _scene_data(scene: Any) -> Any:
    """Return what stands for a scene; raises SceneError for one that its plain data do not give again."""
    known = import_module("pendulum_env.physics.effects").EFFECTS
    own = {type(effect).name: type(effect) for effect in scene.effects
           if known.get(effect.name) is not type(effect)}
    try:
        written = json.loads(json.dumps(scene.to_dict(), allow_nan=False))
        same = _scene(written, own) == scene
    except (TypeError, ValueError):
        same = False
    if not same:
        raise SceneError(f"A file cannot keep the scene '{scene.name}': its dict, Scene.to_dict(), does not give it "
                         "again, perhaps because of a body of your own.")
    return {"$scene": written, **({"own": sorted(own)} if own else {})}


def _pack(path: Path, text: bytes, members: Mapping[str, Any], how: int) -> int:
    """Write a file's members, the JSON text and the arrays; return the sum of their sizes [bytes]."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, one in ((TEXT, text), *members.items()):
            info = zipfile.ZipInfo(name)  # of a fixed date, so that equal results are equal files
            sample = one[:SAMPLE] if isinstance(one, bytes) else one.flat[:SAMPLE // (one.itemsize or 1)].tobytes()
            pays = len(zlib.compress(sample, 1)) < WORTH * len(sample)
            info.compress_type = how if pays else zipfile.ZIP_STORED
            with archive.open(info, "w", force_zip64=True) as file:
                if isinstance(one, bytes):
                    file.write(one)
                else:
                    np.lib.format.write_array(file, one, allow_pickle=False)
        return sum(info.file_size for info in archive.infolist())


# --- reading ----------------------------------------------------------------------------------------------------------


class FileError(ValueError):
    """Error of a file that is no result; the message says why."""


@contextmanager
def _opened(place: Path) -> Iterator[tuple[zipfile.ZipFile, dict[str, Any]]]:
    """Yield a file's archive and the data of its JSON text; raise SceneError for a file that cannot be read."""
    try:
        with zipfile.ZipFile(place) as archive:
            infos = archive.infolist()
            names = [info.filename for info in infos]
            if TEXT not in names:
                raise FileError(f"it is not a file that save wrote, because it has no member {TEXT}")
            for name, count in Counter(names).items():
                if not MEMBER.fullmatch(name) or count > 1:
                    raise FileError(f"its member {shown(name)} is unsafe: a path, or there twice")
            if _bomb(sum(info.file_size for info in infos), place.stat().st_size):
                raise FileError(f"it is unsafe: unpacked, it would be over {RATIO} times as large")
            whole = json.loads(archive.read(TEXT))
            if not isinstance(whole, dict) or whole.get("format") != FORMAT:
                raise FileError("it is not a file that save wrote")
            if type(whole.get("version")) is not int or whole["version"] < 1:
                raise FileError("it does not say the version of its format")
            if whole["version"] > VERSION:
                raise FileError(f"it has the version {whole['version']} of the format, and this package reads "
                                f"versions up to {VERSION}; install a newer lab-pendulum")
            facts = whole.get("provenance")
            if not isinstance(facts, dict) or not all(isinstance(text, str) for text in facts.values()):
                raise FileError("it does not say where the result comes from")
            if "result" not in whole:
                raise FileError("it has no result")
            yield archive, whole
    except FileError as error:
        raise SceneError(f"The file {place} cannot be read: {error}.") from None
    except OSError as error:
        raise SceneError(f"The file {place} cannot be read: {error.strerror or error}.") from None
    except zipfile.BadZipFile as error:
        raise SceneError(f"The file {place} cannot be read: it is not a file that save wrote, or is damaged: {error}."
                         ) from None
    except Exception as error:  # of json, zlib, numpy, of classes that refuse their fields
        raise SceneError(f"The file {place} cannot be read, because it is damaged or a part of it is not valid: "
                         f"{shown_error(error)}.") from error


def shown_error(error: Exception) -> str:
    """Return an exception as words in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:300].rstrip(".: ")


class _Reader:
    """Makes the values of a file."""

    def __init__(self, archive: zipfile.ZipFile, methods: Mapping[str, Any], effects: Mapping[str, type]) -> None:
        self._archive, self._methods, self._effects = archive, methods, effects
        self._met: dict[str, Any] = {}
        self._arrays: dict[str, Any] = {}
        self.changed: list[str] = []

    def value(self, one: Any, place: str) -> Any:
        """Return the value that stands in the JSON text."""
        if isinstance(one, list):
            return self._all(one, place)
        if not isinstance(one, dict):
            return one
        tag = next((key for key in one if key.startswith("$")), None)
        if tag is None:
            return {key: self.value(value, _within(place, part))
                    for part, (key, value) in zip(_parts(one), one.items(), strict=True)}
        if tag not in TAGS:
            raise FileError(f"{place or 'the result'} is of the unknown kind {shown(tag)}")
        return TAGS[tag](self, one, place)

    def _all(self, values: list[Any], place: str) -> list[Any]:
        return [self.value(one, _within(place, str(i))) for i, one in enumerate(values)]

    def _dict(self, one: Any, place: str) -> Any:
        pairs = [(self.value(key, place), value) for key, value in one["$dict"]]
        parts = _parts(key for key, _ in pairs)
        return {key: self.value(value, _within(place, part)) for part, (key, value) in zip(parts, pairs, strict=True)}

    def _float(self, one: Any, place: str) -> float:
        text = one["$float"]
        return float(text) if len(text) < 5 else float(struct.unpack(">d", bytes.fromhex(text))[0])

    def _number(self, one: Any, place: str) -> Any:
        number = self.value(one["$number"], place)
        return number[()] if isinstance(number, np.ndarray) else _dtype(one).type(number)

    def _objects(self, one: Any, place: str) -> Any:
        array = np.empty(len(one["$objects"]), dtype=object)
        array[:] = [None] * len(array)
        for i, value in enumerate(self._all(one["$objects"], place)):
            array[i] = value
        return array.reshape(one["shape"])

    def _array(self, one: Any, place: str) -> Any:
        name = one["$array"]
        if name not in self._arrays:
            try:
                info = self._archive.getinfo(name)
            except KeyError:
                raise FileError(f"its member {shown(name)} is missing") from None
            self._arrays[name] = _array(self._archive, info, _dtype(one), tuple(one["shape"]))
        return self._arrays[name]

    def _same(self, one: Any, place: str) -> Any:
        if one["$same"] not in self._met:
            raise FileError(f"{place} names {shown(one['$same'])}, which does not stand before it")
        return self._met[one["$same"]]

    def _method(self, one: Any, place: str) -> Any:
        name, own = one["$method"], bool(one.get("own"))
        given = self._methods.get(name)
        if given is not None and fingerprint(given) == one["fingerprint"]:
            found = given
        elif own:
            remedy = "the one in methods= has other numbers" if given is not None else (
                "give it, as in load(path, methods=[mine])")
            raise FileError(f"the method {shown(name)} is not of the package; {remedy}")
        else:
            found = _of_package(name)
            if found is None:
                raise FileError(f"there is no method {shown(name)} in this version of the package")
            if fingerprint(found) != one["fingerprint"] and name not in self.changed:
                self.changed.append(name)
        self._met[place] = found
        return found

    def _scene(self, one: Any, place: str) -> Any:
        for name in one.get("own", ()):
            if name not in self._effects:
                raise FileError(f"the effect {shown(name)} is not of the package; give its class, as in load(path, "
                                "effects=[Mine])")
        self._met[place] = _scene(one["$scene"], {name: self._effects[name] for name in one.get("own", ())})
        return self._met[place]

    def _object(self, one: Any, place: str) -> Any:
        name = one["$class"]
        if name not in MODULES:
            raise FileError(f"it has an object of the unknown class {shown(name)}{nearest(name, MODULES)[:-1]}")
        known = _field_names(name)
        values = {field: self.value(value, _within(place, field)) for field, value in one.items() if field != "$class"}
        if name == "Case":
            values = {**_functions(values.get("name")), **values}
        for field in values:
            if field not in known:
                raise FileError(f"a {name} has no field {shown(field)}{nearest(field, known)[:-1]}")
        lacking = [field for field, needed in known.items() if needed and field not in values]
        if lacking:
            raise FileError(f"a {name} lacks the field {lacking[0]}")
        found = _class_of(name)(**values)
        self._met[place] = found
        if name == "Case":
            same = next((case for case in _catalogue() if case == found), found)
            self._met[place] = found = same
        return found


TAGS: Mapping[str, Callable[[Any, Any, str], Any]] = {
    "$class": _Reader._object, "$array": _Reader._array, "$float": _Reader._float, "$dict": _Reader._dict,
    "$tuple": lambda reader, one, place: tuple(reader._all(one["$tuple"], place)),
    "$frozenset": lambda reader, one, place: frozenset(reader._all(one["$frozenset"], place)),
    "$number": _Reader._number, "$objects": _Reader._objects, "$scene": _Reader._scene, "$method": _Reader._method,
    "$same": _Reader._same,
}
"""Key of an object in the JSON text -> function that makes the value."""


def _scene(written: Mapping[str, Any], own: Mapping[str, type]) -> Any:
    """Return the scene of plain data, with effects of these classes of one's own."""
    effects = [own[effect["effect"]](**{key: value for key, value in effect.items() if key != "effect"})
               if effect["effect"] in own else effect for effect in written["effects"]]
    return import_module("pendulum_env.physics.scene").Scene.from_dict({**written, "effects": effects})


def _catalogue() -> Any:
    return import_module("pendulum_env.hard_cases.run").CASES


def _functions(name: Any) -> dict[str, Any]:
    """Return the functions of the hard case of a name; of one that is no longer there, functions that say so."""
    def gone(method: Any) -> Any:
        raise SceneError(f"The hard case {shown(name)} is no longer in the catalogue, so that no method can be tried.")

    case = next((one for one in _catalogue() if one.name == name), None)
    return {"may": gone, "attempt": gone} if case is None else {"may": case.may, "attempt": case.attempt}


def _dtype(one: Mapping[str, Any]) -> Any:
    """Return the type of NumPy that an object names; FileError for one of objects, of fields, or unknown."""
    if not isinstance(one["dtype"], str) or not DTYPE.fullmatch(one["dtype"]):
        raise FileError(f"it has the unknown type of numbers {shown(one['dtype'])}")
    return np.dtype(one["dtype"])


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, dtype: Any, shape: tuple[int, ...]) -> Any:
    """Return the array of a member after a check that it is the declared one, before any memory is taken for it."""
    with archive.open(info) as file:
        found = _header(file)
        left = info.file_size - file.tell()
    if found != (shape, dtype):
        raise FileError(f"its member {shown(info.filename)} is an array of {found[1]} of shape {found[0]}, not of "
                        f"{dtype} of shape {shape} as declared")
    if left != math.prod(shape) * dtype.itemsize:
        raise FileError(f"its member {shown(info.filename)} has {left} bytes, not those of an array of {dtype} of "
                        f"shape {shape}")
    with archive.open(info) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], Any]:
    """Return the shape and the type in the header of an array."""
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    return shape, dtype
