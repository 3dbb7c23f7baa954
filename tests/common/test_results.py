"""Tables of results as JSON, CSV, pandas and xarray: one set of numbers in all of them, with units and origin."""

from __future__ import annotations

import csv
import json
import math
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from small_results import small

from pendulum_env import SceneError
from pendulum_env.common.results import Column, Columns, Result, columns_of, write
from pendulum_env.common.version import sources

pytestmark = pytest.mark.usefixtures("all_interpreted")


class Some(Result):
    """A result with given tables."""

    def __init__(self, tables: Mapping[str, Columns], grid: Sequence[str] = ()) -> None:
        self._tables, self._grid = tables, grid

    def origin(self) -> Mapping[str, str]:
        return {"Software": "a program", "Scene": "vacuum"}

    def tables(self) -> Mapping[str, Columns]:
        return self._tables

    def grid(self) -> Sequence[str]:
        return self._grid


MIXED: Mapping[str, Column] = {
    "method": Column(["rk4", "heun", "rk4", "heun"]),
    "dt_s": Column([0.1, 0.1, 0.05, 0.05], "s"),
    "error_rad": Column([1.0 / 3.0, math.nan, math.inf, None], "rad"),
    "limit": Column([1.5, "", 2, 5e-324]),
    "count": Column((np.int64(3), np.float64(0.1), 5, 2**60)),
    "array_m": Column(np.array([1.0, -0.0, 1e300, -math.inf]), "m"),
    "status": Column(["ok", "", "=1+2", None]),
    "words": Column([1.5, "unknown", None, 2]),
    "flag": Column([True, False, True, False]),
    "perhaps": Column([True, None, "", False]),
    "never": Column([None] * 4),
    "nothing": Column([""] * 4),
}


def some() -> Some:
    return Some({"main": MIXED, "other": columns_of({"a": "s"}, [(1.0,), (2.0,)])}, ("method", "dt_s"))


def in_csv(path: Path) -> tuple[list[str], dict[str, list[str]]]:
    """The lines of a CSV file's head, and its columns as text."""
    lines = path.read_text(encoding="utf-8").splitlines()
    head, *rows = csv.reader(line for line in lines if not line.startswith("# "))
    columns = dict(zip(head, map(list, zip(*rows, strict=True)), strict=True)) if rows else {name: [] for name in head}
    return [line for line in lines if line.startswith("# ")], columns


RESULTS = {"Growth": lambda: small("Growth"), "CostStudy": lambda: small("CostStudy"), "mixed": some,
           "empty": lambda: Some({"main": columns_of({"a": "s", "b": ""}, [])}, ("a",))}


@pytest.mark.parametrize("kind", RESULTS)
def test_json_has_the_numbers_of_the_csv_files(kind: str, tmp_path: Path) -> None:
    def refused(text: str) -> None:
        raise AssertionError(f"{text} is no JSON")

    result = RESULTS[kind]()
    paths = write(Tables(result), tmp_path)
    data = json.loads(result.to_json(settings={"a": 1}), parse_constant=refused)
    assert data["result"] == type(result).__name__
    assert data["settings"] == {"a": 1}
    assert [f"{name}.csv" for name in data["tables"]] == [path.name for path in paths]
    for path, table in zip(paths, data["tables"].values(), strict=True):
        head, columns = in_csv(path)
        assert [line.partition(": ")[0][2:] for line in head] == [*data["provenance"]]
        assert table["units"] == {name: one.unit for name, one in result.tables()[path.stem].items()}
        assert set(table["columns"]) == set(columns)
        for name, texts in columns.items():
            for text, value in zip(texts, table["columns"][name], strict=True):
                assert same(text, value), (name, text, value)


class Tables(Some):
    """The tables and the origin of another result, without its figures."""

    def __init__(self, other: Any) -> None:
        super().__init__(other.tables())
        self.origin = other.origin  # type: ignore[method-assign]


def same(text: str, value: Any) -> bool:
    """True if the text of a cell and a value of JSON are one value."""
    if value is None:
        return text in ("", "nan")
    if isinstance(value, bool):
        return text == str(value)
    if isinstance(value, (int, float)):
        return float(text) == value and math.copysign(1.0, float(text)) == math.copysign(1.0, value)
    return text not in ("nan", "NaN") and text.removeprefix("'") == value


def close(read: Any, own: Any) -> bool:
    """True if pandas read a number, to the last digits, which older versions of it round otherwise."""
    return isinstance(own, float) and math.isclose(float(read), own, rel_tol=1e-15)


@pytest.mark.parametrize("kind", RESULTS)
def test_pandas_has_what_it_reads_from_the_csv_file(kind: str, tmp_path: Path) -> None:
    result = RESULTS[kind]()
    for path in write(Tables(result), tmp_path):
        frame = result.to_pandas(path.stem)
        again = pandas.read_csv(path, comment="#", keep_default_na=False, na_values=["nan"])
        assert list(frame) == list(again)
        for name in frame:
            for own, read in zip(frame[name].tolist(), again[name].tolist(), strict=True):
                empty = own is None or own == "" or own != own
                assert (read in ("", "nan") or read != read) if empty else (
                    close(read, own) or str(own) == str(read).removeprefix("'")), (name, own, read)
        assert frame.attrs["units"] == {name: column.unit for name, column in result.tables()[path.stem].items()}
        assert frame.attrs["provenance"] == dict(result.origin())


def test_empty_cells_are_those_of_the_kind_of_their_column() -> None:
    frame = some().to_pandas()
    numbers = ("dt_s", "error_rad", "limit", "count", "array_m", "never")
    assert {name: frame[name].dtype.kind for name in numbers} == dict.fromkeys(numbers, "f")
    assert frame["flag"].dtype == bool
    assert frame["perhaps"].tolist() == [True, None, None, False]
    assert frame["status"].tolist() == ["ok", "", "=1+2", ""]
    assert frame["nothing"].tolist() == [""] * 4
    assert frame["never"].isna().all()
    assert frame["words"].tolist()[:2] == [1.5, "unknown"]
    assert math.isnan(frame["words"][2])


@pytest.mark.slow
def test_xarray_has_the_grids_quantities_as_dimensions() -> None:
    data = some().to_xarray()
    assert dict(data.sizes) == {"method": 2, "dt_s": 2}
    assert data["method"].values.tolist() == ["rk4", "heun"]  # in the order of the rows
    assert data["dt_s"].values.tolist() == [0.1, 0.05]
    for i in range(4):
        at = {"method": MIXED["method"].values[i], "dt_s": MIXED["dt_s"].values[i]}
        assert float(data["array_m"].sel(at)) == MIXED["array_m"].values[i]
        assert data["flag"].sel(at).item() is MIXED["flag"].values[i]
    assert data["error_rad"].sel({"method": "rk4", "dt_s": 0.1}).item() == 1.0 / 3.0
    assert {name: data[name].attrs.get("units") for name in ("dt_s", "error_rad", "array_m", "method")} == {
        "dt_s": "s", "error_rad": "rad", "array_m": "m", "method": None}
    assert data.attrs == {"Software": "a program", "Scene": "vacuum"}
    assert some().to_xarray("main").equals(data)
    assert dict(some().to_xarray("other").sizes) == {"row": 2}


@pytest.mark.quick("CostStudy")
@pytest.mark.parametrize("name", ["Growth", "CostStudy"])
def test_xarray_of_a_study_has_its_values(name: str) -> None:
    result = small(name)
    data, (main, *_) = result.to_xarray(), result.tables().values()
    assert set(data.dims) == set(result.grid()) or set(data.dims) == {"row"}
    if name == "Growth":
        assert data.sizes == {"method": 2, "time_periods": len(result.time)}
        for i, line in enumerate(result.lines):
            assert data["angle_error_rad"].values[i].tobytes() == line.angle_error.tobytes()
        assert data["angle_error_rad"].attrs["units"] == "rad"
        assert data["time_periods"].attrs["units"] == "periods"
    assert data.attrs["Sources"] == sources()
    assert {name: sorted(map(str, data[name].values.flat)) for name in main if name not in result.grid()} == {
        name: sorted(map(str, values)) for name, values in result.to_pandas().items() if name not in result.grid()}


@pytest.mark.parametrize(("change", "dims"), [
    ({"dt_s": Column([0.1, 0.1, 0.05, 0.07], "s")}, {"row": 4}),  # not every combination
    ({"dt_s": Column([0.1] * 4, "s")}, {"row": 4}),  # some twice
    ({"dt_s": Column([0.1, 0.1, None, None], "s")}, {"row": 4}),  # no value
    ({"row": Column([1, 2, 3, 4]), "dt_s": Column([0.1] * 4, "s")}, {"row number": 4}),
])
def test_xarray_of_an_incomplete_grid_has_rows(change: Any, dims: Any) -> None:
    data = Some({"main": {**MIXED, **change}}, ("method", "dt_s")).to_xarray()
    assert dict(data.sizes) == dims
    assert data["method"].values.tolist() == MIXED["method"].values


def test_a_table_without_rows_or_columns() -> None:
    empty = Some({"main": columns_of({"a": "s", "b": ""}, [])}, ("a",))
    assert list(empty.to_pandas()) == ["a", "b"]
    assert dict(empty.to_xarray().sizes) == {"a": 0}
    none = Some({"main": {}})
    assert none.to_pandas().empty
    assert not none.to_xarray().data_vars


def test_unknown_tables_and_missing_libraries_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for read in (some().to_pandas, some().to_xarray):
        with pytest.raises(SceneError, match="There is no table 'man'; did you mean main"):
            read("man")
    for name in ("xarray", "pandas"):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(SceneError, match=rf'needs {name}, .*: pip install "lab-pendulum\[{name}\]"\.'):
            getattr(some(), f"to_{name}")()


@pytest.mark.slow
def test_pandas_and_xarray_are_loaded_only_when_they_are_asked_for() -> None:
    code = ("import sys, pendulum_env.study.growth, pendulum_env.study.cost\n"
            "print([name for name in ('pandas', 'xarray') if name in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_write_refuses_what_is_no_result(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="write takes the result of a study"):
        write({"a": 1}, tmp_path / "out")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
