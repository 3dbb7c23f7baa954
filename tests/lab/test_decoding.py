"""Tests of damaged and malicious files: one error for all decoders, and limits that can be lifted."""

from __future__ import annotations

import os
import random
import struct
import subprocess
import sys
import tracemalloc
import zipfile
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from archives import ROWS, TABLE, archive, damaged, ods, xlsx
from old_workbook import old_workbook

from pendulum_env import Recording
from pendulum_env.lab import RecordingError, measure_gate
from pendulum_env.lab.containers import text_of
from pendulum_env.lab.decoding import Limits, check, limits

DEEP = ('<?xml version="1.0"?><object class="org.opensourcephysics.cabrillo.tracker.TrackerPanel">{}</object>')
WHOLE: dict[str, bytes] = {
    **{f"zip {kind}": archive({"swing.csv": TABLE * 20, "meta/time.csv": "x"}, kind) for kind in (
        zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)},
    "xlsx": xlsx(), "ods": ods(), "xls": old_workbook([("one", ROWS)]),
    "track": DEEP.format('<object class="org.PointMass"><property name="name">a</property></object>').encode(),
    "text": TABLE.encode(),
}


def read(path: Path, data: bytes) -> str:
    """Return the text of a file of these bytes."""
    path.write_bytes(data)
    return text_of(str(path))[0]


@pytest.mark.quick("xlsx", "ods")
@pytest.mark.parametrize("kind", WHOLE)
def test_a_damaged_file_has_one_error(kind: str, tmp_path: Path) -> None:
    """Whatever decoder fails: a text, or RecordingError with the file's name, and never anything else."""
    source, refused = random.Random(kind), 0
    for _ in range(150):
        why = ""
        try:
            read(tmp_path / "swing.file", damaged(WHOLE[kind], source))
        except RecordingError as error:
            why = str(error)
        if why:
            refused += 1
            assert why.startswith(str(tmp_path / "swing.file"))
            assert "\n" not in why
    assert kind == "text" or refused > 20


def header(data: bytes, offset: int, value: bytes) -> bytes:
    """Return an archive of one file with a field replaced in its local and its central header (APPNOTE 4.3)."""
    found = bytearray(data)
    for mark, more in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
        place = found.index(mark) + offset + more
        found[place : place + len(value)] = value
    return bytes(found)


@pytest.mark.parametrize(("offset", "value", "why"), [
    (6, b"\x01\x00", "encrypted"), (8, b"\x09\x00", "NotImplementedError"), (8, b"\x0e\x00", "BadZipFile"),
    (8, b"\x0c\x00", "Invalid data stream"), (14, b"\0\0\0\0", "CRC"),
])
def test_headers_of_archives_that_lie(offset: int, value: bytes, why: str, tmp_path: Path) -> None:
    """Encrypted files, unknown methods of compression, wrong sizes and sums."""
    with pytest.raises(RecordingError, match=f"swing.zip.*damaged or encrypted file.*{why}"):
        read(tmp_path / "swing.zip", header(archive({"swing.csv": TABLE}), offset, value))


def bomb() -> bytes:
    """Return an archive of 0.3 MB that unpacks to 320 MB."""
    return archive({"swing.csv": b"0,1\n" * 80_000_000})


def test_whole_files_are_read(tmp_path: Path) -> None:
    for kind, data in WHOLE.items():
        if kind != "track":
            assert "0.8" in read(tmp_path / "swing.file", data), kind


TOO_LARGE: dict[str, tuple[bytes, str]] = {
    "a last cell": (xlsx('<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>'), "1000 columns"),
    "a last cell without its place": (xlsx("<row r='1048576'><c><v>1</v></c><c r='ALL1'><v>1</v></c></row>"),
                                      "20000000 cells"),
    "a repeated cell": (ods('<table:table-row table:number-rows-repeated="1048576"><table:table-cell '
                            'table:number-columns-repeated="900" office:value-type="float" office:value="1"/>'
                            "</table:table-row>"), "20000000 cells"),
    "repeated rows before a cell": (ods('<table:table-row table:number-rows-repeated="99000000"/><table:table-row>'
                                        '<table:table-cell office:value-type="float" office:value="1"/>'
                                        "</table:table-row>"), "5000000 rows"),
    "entries": (archive({f"{i}.csv": "" for i in range(10_001)}, zipfile.ZIP_STORED), "10000 entries"),
    "nesting": (DEEP.format("<object>" * 100 + "</object>" * 100).encode(), "100 nesting"),
    "columns": (b"1,2" + b",3" * 1000 + b"\n", "1000 columns"),
    "characters": (b"0,1\n" + b'"' + b"9" * 100_001 + b'",1\n', "100000 characters"),
    "rows": (b"1\n" * 5_000_001, "5000000 rows"),
}


@pytest.mark.parametrize("case", [
    pytest.param(case, marks=pytest.mark.slow if case in ("entries", "rows") else ()) for case in TOO_LARGE])
def test_what_is_too_large_is_refused_before_memory_is_taken(case: str, tmp_path: Path) -> None:
    data, what = TOO_LARGE[case]
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError, match=f"swing.file.*at most {what}, found more.*LAB_PENDULUM_LIMITS=off"):
            read(tmp_path / "swing.file", data)
        assert tracemalloc.get_traced_memory()[1] < 60e6 + 3 * len(data)
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("place", [(14649, 14649), (65535, 256), (65535, 255)])
def test_the_farthest_cell_of_an_old_workbook_takes_no_memory(place: tuple[int, int], tmp_path: Path) -> None:
    """An .xls has at most 65536 rows of 256 columns ([MS-XLS] 2.5.206, 2.5.16): a damaged one may name any cell."""
    whole = old_workbook([("one", [*ROWS, ("last", 0.125)])])
    here, there = struct.pack("<HHHd", len(ROWS), 1, 0, 0.125), struct.pack("<HHHd", *place, 0, 0.125)
    assert whole.count(here) == 1
    tracemalloc.start()
    try:
        if place[1] > 255:
            with pytest.raises(RecordingError, match="damaged or encrypted"):
                read(tmp_path / "swing.xls", whole.replace(here, there))
        else:
            assert read(tmp_path / "swing.xls", whole.replace(here, there)).endswith("\t0.125\n")
        assert tracemalloc.get_traced_memory()[1] < 60e6
    finally:
        tracemalloc.stop()


def test_dates_of_an_old_workbook_keep_their_seconds(tmp_path: Path) -> None:
    begin = datetime(2026, 3, 1, 9, 30)
    rows = [("Time", "Angle (deg)"), *((begin + timedelta(seconds=15 * i), 2.0 * i) for i in range(4))]
    lines = read(tmp_path / "swing.xls", old_workbook([("one", rows)])).splitlines()
    assert lines[1:] == [f"2026-03-01T09:3{i // 4}:{15 * (i % 4):02d}\t{2.0 * i}" for i in range(4)]


def test_the_limit_of_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a file, of a file in an archive, and of a workbook, all of which are unpacked; the limit is smaller here."""
    fewer = (3000, *Limits()[1:])
    monkeypatch.setattr(Limits, "__new__", lambda kind: tuple.__new__(kind, fewer))
    for data in (b"0,1\n" * 1000, archive({"swing.csv": b"0,1\n" * 1000}), xlsx("<row/>" * 500)):
        with pytest.raises(RecordingError, match="at most 3000 bytes, found more"):
            read(tmp_path / "swing.file", data)


@pytest.mark.slow
def test_an_archive_that_unpacks_to_more_than_the_memory_allows(tmp_path: Path) -> None:
    """In a process that may use 1.5 GB of memory, with the limit of the package."""
    (tmp_path / "swing.zip").write_bytes(bomb())
    script = ("import resource, sys\nfrom pendulum_env import Recording\n"
              "resource.setrlimit(resource.RLIMIT_AS, (3 * 2**29,) * 2)\nRecording.read(sys.argv[1])")
    done = subprocess.run([sys.executable, "-c", script, tmp_path / "swing.zip"], capture_output=True, text=True)
    assert "268435456 bytes, found more" in done.stderr.splitlines()[-1]


def test_limits_can_be_lifted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, columns = tmp_path / "wide.csv", 1001
    path.write_text("".join(",".join([f"{0.1 * i:.1f}", *[f"{(-1.0) ** i}"] * columns]) + "\n" for i in range(9)))
    with pytest.raises(RecordingError, match="1000 columns"):
        Recording.read(path, columns=(1, 2), unit="rad")
    monkeypatch.setenv("LAB_PENDULUM_LIMITS", "off")
    assert len(Recording.read(path, columns=(1, 2), unit="rad").time) == 9
    check("any", "bytes", 2**62)
    monkeypatch.setenv("LAB_PENDULUM_LIMITS", "none")
    with pytest.raises(RecordingError, match="LAB_PENDULUM_LIMITS must be 'on' or 'off', not 'none'"):
        limits()


def test_a_long_field_is_no_error_of_another_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python's reader of CSV takes at most 131 072 characters in a field."""
    monkeypatch.setenv("LAB_PENDULUM_LIMITS", "off")
    path = tmp_path / "long.csv"
    path.write_text(TABLE + '0.9,"' + "9" * 200_000 + '"\n')
    assert len(Recording.read(path).time) >= 8


FOUND: dict[str, tuple[str, str]] = {
    "a day that is none": ("time,angle\n2024-13-45 10:00:00,1\n2024-13-45 10:00:01,2\n", "found no numbers"),
    "a run with 5000 digits": ("time run 1,angle run 1,time run " + "2" * 5000 + ",b\n" + "0,1,0,1\n1,2,1,2\n",
                               "swing.csv"),
}
"""Texts that the fuzzer found, with a word of their refusal."""


@pytest.mark.parametrize("case", [
    pytest.param(case, marks=pytest.mark.slow if case == "a run with 5000 digits" else ()) for case in FOUND])
def test_what_the_fuzzer_found(case: str, tmp_path: Path) -> None:
    text, word = FOUND[case]
    path = tmp_path / "swing.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=word):
        Recording.read(path)
    with pytest.raises(RecordingError):
        measure_gate(path)


def test_an_endless_file_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not os.path.exists("/dev/zero"):
        pytest.skip("only POSIX has an endless file")
    fewer = (3000, *Limits()[1:])
    monkeypatch.setattr(Limits, "__new__", lambda kind: tuple.__new__(kind, fewer))
    with pytest.raises(RecordingError, match="at most 3000 bytes"):
        text_of("/dev/zero")


def test_a_decoder_that_gives_up_and_a_user_who_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Decoders in Rust raise a BaseException of their own; Ctrl-C is not taken for a damaged file."""
    import python_calamine

    class PanicException(BaseException):
        """As that of pyo3."""

    errors = ((PanicException("index out of bounds"), RecordingError), (KeyboardInterrupt(), KeyboardInterrupt))
    for error, raised in errors:
        def fail(*_: Any, error: BaseException = error) -> Any:
            raise error

        with monkeypatch.context() as patch:
            patch.setattr(python_calamine.CalamineWorkbook, "from_filelike", fail, raising=False)
            with pytest.raises(raised):
                read(tmp_path / "swing.xlsx", xlsx())
