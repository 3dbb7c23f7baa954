"""Files of other programs, written here by hand, by SciPy and by NumPy: values as they are, and one error for the rest.

The truth is a swing by SciPy's DOP853. Nothing here calls a writer of the package.
"""

from __future__ import annotations

import io
import math
import pickle
import random
import re
import zipfile
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pytest
from archives import damaged
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.io import savemat

from pendulum_env.lab import Recording, RecordingError, fit
from pendulum_env.lab.containers import FORMATS, text_of

Array = NDArray[np.float64]
GRAVITY, LENGTH, GAMMA = 9.80665, 0.5, 0.05
TIME = np.round(np.arange(0.0, 30.0, 0.02), 2)
SWING = solve_ivp(lambda _t, y: [y[1], -GRAVITY / LENGTH * math.sin(y[0]) - GAMMA * y[1]], (0.0, 30.0),
                  [math.radians(35.0), 0.0], t_eval=TIME, method="DOP853", rtol=1e-10, atol=1e-12).y
ANGLE: Array = np.round(SWING[0], 5)
RATE: Array = SWING[1]
DISTANCE = 0.4
"""Distance of the accelerometer from the pivot [m]."""
ALONG = -(GRAVITY * np.cos(SWING[0]) + DISTANCE * RATE**2)
ACROSS = GRAVITY * np.sin(SWING[0]) + DISTANCE * (-GRAVITY / LENGTH * np.sin(SWING[0]) - GAMMA * RATE)
"""Specific force along the rod and across it [m/s²]."""


def read(folder: Path, data: str | bytes, name: str = "swing.file", **options: Any) -> Recording:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return Recording.read(path, **options)


def check(recording: Recording, atol: float = 1e-12) -> None:
    """Check that times and angles are those of the swing."""
    np.testing.assert_allclose(recording.time, TIME, atol=1e-9)
    np.testing.assert_allclose(recording.angle, ANGLE, atol=atol)


def table(header: str, *columns: Array) -> str:
    return header + "\n" + "".join(",".join(f"{x:.10g}" for x in row) + "\n" for row in zip(*columns, strict=True))


# --- Logger Pro -----------------------------------------------------------------------------------------------------


def cmbl(**sets: list[tuple[str, str, list[str]]]) -> str:
    """A file of Logger Pro: elements, their order and blanks as its own files have them."""
    parts = ['<?xml version="1.0" encoding="UTF-8" ?>\n<Document>\n  <FileCreationVersion>3.15</FileCreationVersion>\n']
    for title, columns in sets.items():
        parts.append(f"  <DataSet>\n    <ID>9 </ID>\n    <DataSetName>{title.replace('_', ' ')}</DataSetName>\n")
        for name, unit, cells in columns:
            parts.append(
                f"    <DataColumn>\n      <ID>10 </ID>\n      <DataObjectName>{escape(name)}</DataObjectName>\n      "
                f"<DataObjectShortName>a</DataObjectShortName>\n      <ColumnUnits>{escape(unit)}</ColumnUnits>\n      "
                "<ColumnCells>" + "".join(f"\n{cell}" for cell in cells) + "\n</ColumnCells>\n    </DataColumn>\n")
        parts.append("  </DataSet>\n")
    parts.append("  <DataSet>\n    <DataSetName>CurveFitFunctions</DataSetName>\n  </DataSet>\n</Document>\n")
    return "".join(parts)


TIMES, RADIANS = [f"{t:.2f}" for t in TIME], [f"{a:.5f}" for a in ANGLE]
LATEST = [("Time", "s", TIMES), ("Angle", "rad", RADIANS), ("Velocity", "rad/s", [f"{w:.4f}" for w in RATE])]


def test_logger_pro(tmp_path: Path) -> None:
    found = read(tmp_path, cmbl(Latest=LATEST))
    check(found)
    assert "Logger Pro: Latest is read" in found.notes
    degrees = [("Time", "s", TIMES), ("Angle", "°", [f"{np.degrees(a):.9f}" for a in ANGLE])]
    check(read(tmp_path, cmbl(Latest=degrees)), atol=1e-9)


def test_cells_of_logger_pro_without_a_number_are_missing_readings(tmp_path: Path) -> None:
    cells = ["Z1 1:" if k in (5, 6) else cell for k, cell in enumerate(RADIANS)]
    found = read(tmp_path, cmbl(Latest=[("Time", "s", TIMES), ("Angle", "rad", cells[:-1])]))
    seen = np.delete(np.arange(len(TIME)), [5, 6, len(TIME) - 1])
    np.testing.assert_allclose(found.time, TIME[seen], atol=1e-9)
    np.testing.assert_allclose(found.angle, ANGLE[seen], atol=1e-12)


def test_several_data_sets_of_logger_pro_are_chosen_by_part(tmp_path: Path) -> None:
    other = [("Time", "s", TIMES), ("Angle", "rad", [f"{2 * a:.5f}" for a in ANGLE])]
    text = cmbl(Run_1=other, Latest=LATEST)
    with pytest.raises(RecordingError, match="expected one table with numbers, found Run 1, Latest; choose one by"):
        read(tmp_path, text)
    check(read(tmp_path, text, part="Latest"))


@pytest.mark.parametrize(("columns", "why"), [
    ([("Time", "s", [t.replace(".", ",") for t in TIMES]), *LATEST[1:]], "'Time': expected numbers with decimal"),
    ([("Note", "", ["x", "1", "2", "3", *["y"] * 5]), *LATEST], "'Note': more than half of its cells are no numbers"),
    ([], "expected a table with numbers, found none"),
])
def test_columns_of_logger_pro_that_are_refused(columns: Any, why: str, tmp_path: Path) -> None:
    text = cmbl(Latest=columns).replace("</Document>", "<ColumnCells></ColumnCells></Document>")
    with pytest.raises(RecordingError, match=re.escape(why)):
        read(tmp_path, text)


# --- MATLAB ---------------------------------------------------------------------------------------------------------


def mat(**keywords: Any) -> bytes:
    """A MATLAB file by SciPy; ``options`` are those of savemat, everything else its variables."""
    options, file = keywords.pop("options", {}), io.BytesIO()
    savemat(file, keywords, **options)
    return file.getvalue()


@pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}, {"oned_as": "column"}])
def test_matlab(options: dict[str, Any], tmp_path: Path) -> None:
    found = read(tmp_path, mat(t=TIME, theta=ANGLE, options=options), "swing.mat")
    check(found)
    assert "MATLAB: t, theta are read" in found.notes


def test_other_variables_of_matlab_are_passed_over(tmp_path: Path) -> None:
    data = mat(name="my swing", length=0.5, info={"x": 1.0}, cells=np.array([1, "a"], dtype=object), t=TIME,
               angle_deg=np.degrees(ANGLE))
    check(read(tmp_path, data, "swing.mat"), atol=1e-9)


def test_matrices_of_matlab(tmp_path: Path) -> None:
    both = np.stack([TIME, ANGLE])
    for matrix in (both, both.T, np.asfortranarray(both)):
        check(read(tmp_path, mat(data=matrix), "swing.mat"))
    check(read(tmp_path, mat(t=TIME, x=np.stack([0.0 * ANGLE, ANGLE])), "swing.mat", columns=("t", "x 2"), unit="rad"))


@pytest.mark.parametrize(("data", "why"), [
    (mat(s={"t": TIME, "theta": ANGLE}), "expected vectors of numbers, found s (struct); save them by themselves"),
    (mat(t=TIME, z=ANGLE + 1j), "expected real numbers, found complex ones in z"),
    (b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + b" " * 90 + b"\x89HDF\r\n\x1a\n" + b"\0" * 400,
     "this MATLAB file is of version 7.3, which is not read; save it in MATLAB by save('swing.mat', 't', 'angle', "),
    (mat(t=TIME, a=ANGLE, u=TIME[:50], b=ANGLE[:50]), "expected one table with numbers, found t, a, u, b; choose"),
    (mat(name="nothing"), "expected vectors of numbers, found name (char)"),
])
def test_matlab_files_that_are_refused(data: bytes, why: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=re.escape(why)):
        read(tmp_path, data, "swing.mat")


# --- NumPy ----------------------------------------------------------------------------------------------------------


def npz(compressed: bool = False, **arrays: Any) -> bytes:
    file = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(file, **arrays)
    return file.getvalue()


def npy(array: Any) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def test_numpy(tmp_path: Path) -> None:
    for data in (npz(t=TIME, theta=ANGLE), npz(True, t=TIME, theta=ANGLE, length=0.5),
                 npz(both=np.array([TIME, ANGLE])),
                 npz(time=TIME[:, None], theta=ANGLE.astype(">f8"), name=np.array("swing")),
                 npy(np.column_stack([TIME, ANGLE])), npy(np.array([TIME, ANGLE]))):
        check(read(tmp_path, data))
    records = np.array(list(zip(TIME, ANGLE, strict=True)), dtype=[("t", "f8"), ("theta", "f8")])
    check(read(tmp_path, npy(records)))
    milliseconds = npz(ms=np.round(1000 * TIME).astype(int), angle_deg=np.degrees(ANGLE))
    check(read(tmp_path, milliseconds), atol=1e-9)


class Harm:
    """An object whose pickle would write a file."""

    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self) -> Any:
        return Path.write_text, (self.target, "harm")


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    target = tmp_path / "harm.txt"
    objects = np.array([Harm(target), Harm(target), Harm(target)], dtype=object)
    pickle.loads(pickle.dumps(objects))
    assert target.exists()
    target.unlink()
    for data in (npz(t=TIME, theta=objects), npy(objects), npz(t=np.array([1, None, 2], dtype=object))):
        with pytest.raises(RecordingError, match="found one of Python objects, which are not read, as they could"):
            read(tmp_path, data)
    assert not target.exists()


def lied(shape: str) -> bytes:
    """An array whose header claims another shape."""
    return npy(ANGLE).replace(f"({len(ANGLE)},)".encode(), shape.encode().ljust(len(f"({len(ANGLE)},)")))


@pytest.mark.parametrize(("data", "why"), [
    (npz(t=TIME, z=ANGLE * 1j), "expected real numbers, found complex ones in z"),
    (lied("(10,)"), "expected 10 values of 8 bytes, found 12000 bytes: the file is damaged"),
    (lied("(9**9,)"), "damaged"),
    (npz(t=TIME, a=ANGLE, u=TIME[:50], b=ANGLE[:50]), "expected one table with numbers, found t, a, u, b; choose"),
    (npz(a=np.zeros((2, 2, 2)), b=1.0), "expected a table with numbers, found none"),
])
def test_numpy_files_that_are_refused(data: bytes, why: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=re.escape(why)):
        read(tmp_path, data)


# --- phyphox --------------------------------------------------------------------------------------------------------


def phyphox(values: dict[str, str], export: str) -> str:
    """A saved state of phyphox: values in the containers' attribute init, as its sources have it."""
    containers = "".join(f'<container size="0" static="false"{values[name]}>{name}</container>' for name in values)
    return ('<phyphox version="1.14" locale="en"><title>Gyroscope</title><state-title>swing</state-title>'
            f"<data-containers>{containers}</data-containers><input><sensor type=\"gyroscope\"/></input>"
            f"<export>{export}</export></phyphox>")


def init(values: Array) -> str:
    return f' init="{",".join(repr(float(x)) for x in values)}"'


GYROSCOPE = "".join(f'<data name="{title}">{buffer}</data>' for title, buffer in (
    ("Time (s)", "gyr_time"), ("Gyroscope x (rad/s)", "gyrX"), ("Gyroscope y (rad/s)", "gyrY"),
    ("Absolute (rad/s)", "gyr")))


def test_phyphox(tmp_path: Path) -> None:
    values = {"gyr_time": init(TIME), "gyrX": init(RATE), "gyrY": init(0.001 * np.cos(TIME)), "gyr": "",
              "n": ' init="1"'}
    other = '<set name="n"><data name="n">n</data></set>'
    found = read(tmp_path, phyphox(values, f'<set name="Raw data">{GYROSCOPE}</set>{other}'))
    assert found.rate is not None
    np.testing.assert_allclose(np.abs(found.rate), np.abs(RATE), atol=5e-3)
    assert "phyphox: Raw data is read" in found.notes


def test_phyphox_files_that_are_refused(tmp_path: Path) -> None:
    empty = {"gyr_time": "", "gyrX": "", "gyrY": "", "gyr": ""}
    with pytest.raises(RecordingError, match="this phyphox experiment holds no data; in phyphox choose Save"):
        read(tmp_path, phyphox(empty, f'<set name="Raw data">{GYROSCOPE}</set>'))
    short = {**empty, "gyr_time": init(TIME), "gyrX": init(RATE[:-5])}
    with pytest.raises(RecordingError, match="Raw data: expected columns of one length, found 1495 to 1500 values"):
        read(tmp_path, phyphox(short, f'<set name="Raw data">{GYROSCOPE}</set>'))


# --- micro:bit ------------------------------------------------------------------------------------------------------


def my_data(table: str) -> bytes:
    """MY_DATA.HTM as the micro:bit's log (CODAL) lays it out: page, addresses from 0x800, data from 0x2000."""
    script = "o=d.documentElement.outerHTML.split(\"FS_START\")[2];if(/^UBIT_LOG_FS_V_002/.test(o)){}"
    page = f"<!doctype html><meta charset=utf-8><script>{script}</script>".encode().ljust(0x800 - 12) + b"<!--FS_START"
    addresses = b"UBIT_LOG_FS_V_002\n0x0001EFFC\x000x00002000\x000257\x00"
    journal = addresses.ljust(0x1000 - 0x800, b"\xff") + b"00000000".ljust(0x1000, b"\xff")
    return (page + journal + table.encode()).ljust(0x2EFFC, b"\xff") + b"\0\0\0\0"


def test_the_layout_of_the_micro_bit_here_is_that_of_its_sources() -> None:
    data = my_data("Time (seconds),a\n")
    assert data[0x800:0x812] == b"UBIT_LOG_FS_V_002\n"
    assert data[0x2000:0x2004] == b"Time"
    assert data.index(b"0x00002000") == 0x800 + 29


def test_a_log_of_a_micro_bit(tmp_path: Path) -> None:
    text = table("Time (seconds),angle (rad)", TIME, ANGLE)
    for data in (my_data(text), text.encode()):
        check(read(tmp_path, data, "MY_DATA.HTM"))


@pytest.mark.slow
def test_milli_g_of_a_micro_bit(tmp_path: Path) -> None:
    forces = (np.round(1000.0 * part / GRAVITY) for part in (ACROSS, ALONG, 0.01 * (np.arange(1500) % 2)))
    text = table("Time (seconds),acc_x,acc_y,acc_z", TIME, *forces)
    found = read(tmp_path, my_data(text), "MY_DATA.HTM", sensor=DISTANCE)
    assert "acceleration: in mg of 0.00980665 m/s²" in found.notes
    assert found.force is not None
    assert float(found.force.mean()) == pytest.approx(float(-ALONG.mean()), abs=0.05)
    result = fit(found, "linear")
    assert result.parameters["length"].value == pytest.approx(LENGTH, rel=0.02)


def test_a_log_with_two_tables_is_chosen_by_part(tmp_path: Path) -> None:
    text = table("Time (seconds),light", TIME[:20], ANGLE[:20]) + table("Time (seconds),angle (rad),light", TIME, ANGLE,
                                                                       ANGLE)
    check(read(tmp_path, my_data(text)))
    with pytest.raises(RecordingError, match="there is no table 'other'; there are Time \\(seconds\\), light, Time"):
        read(tmp_path, my_data(text), part="other")


@pytest.mark.parametrize(("data", "why"), [
    (my_data(""), "this log of a micro:bit holds no data; copy MY_DATA.HTM again"),
    (my_data("Time (seconds),a\n"), "this log of a micro:bit holds no data"),
    (my_data(table("t,a", TIME, ANGLE)).replace(b"0x00002000", b"0x0000zz00"), "expected the address of the data"),
    (my_data(table("t,a", TIME, ANGLE)).replace(b"0x00002000", b"0x00000000"), "this log of a micro:bit holds no data"),
    (my_data("1,2\n3,4\n"), "expected titles before values in a line of the log, found '1,2'"),
    (my_data("t,a\n1,2,3\n"), "expected 2 values in a line of the log, found '1,2,3'"),
])
def test_logs_of_a_micro_bit_that_are_refused(data: bytes, why: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=re.escape(why)):
        read(tmp_path, data)


# --- counts ---------------------------------------------------------------------------------------------------------


@pytest.mark.quick("ax,ay,az-2048", "AccX_raw,AccY_raw,AccZ_raw-512")
@pytest.mark.parametrize("counts", [256, 512, 2048, 4096, 16384])
@pytest.mark.parametrize("names", ["ax,ay,az", "AccX_raw,AccY_raw,AccZ_raw"])
def test_counts_of_an_accelerometer_are_recognised_by_gravity(names: str, counts: int, tmp_path: Path) -> None:
    forces = (np.round(counts * part / GRAVITY) for part in (ACROSS, ALONG, 0.01 * (np.arange(1500) % 3)))
    found = read(tmp_path, table(f"t,{names}", TIME, *forces), sensor=DISTANCE)
    note = f"acceleration: in counts, {counts} per g, as their mean is that of gravity (scale= overrides)"
    assert note in found.notes
    assert found.force is not None
    np.testing.assert_allclose(found.force[:1400], -ALONG[:1400], atol=GRAVITY / counts + 0.02)


def test_accelerations_that_are_no_counts_are_refused_as_before(tmp_path: Path) -> None:
    text = table("t,ax,ay", TIME, 900.5 * ALONG, 900.5 * ACROSS)
    with pytest.raises(RecordingError, match=r"is 9074 m/s², not that of gravity, 9\.81 m/s²; check their"):
        read(tmp_path, text)


COUNTED = np.round(np.degrees(RATE) * 131.0)


def test_counts_of_a_gyroscope(tmp_path: Path) -> None:
    text = table("t,gyro_x", TIME, COUNTED)
    with pytest.raises(RecordingError, match=r"too fast for a pendulum in rad/s, .* scale=1/131, unit=deg for an MPU"):
        read(tmp_path, text)
    for found in (read(tmp_path, text, scale=1.0 / 131.0, unit="deg"), read(tmp_path, f"MPU6050 ±250 °/s\n{text}"),
                  read(tmp_path, f"# MPU-6050, range 250 dps\n{text}")):
        assert found.rate is not None
        np.testing.assert_allclose(found.rate, RATE, atol=1e-3)
    converted = table("t,omega (deg/s)", TIME, np.round(np.degrees(RATE)))
    found = read(tmp_path, f"MPU6050 ±250 °/s\n{converted}")
    assert found.rate is not None
    np.testing.assert_allclose(found.rate, RATE, atol=0.01)


TURNED = np.round(2048.0 + ANGLE / (2.0 * math.pi) * 4096.0)
STEP = 2.0 * math.pi / 4096.0


@pytest.mark.parametrize("title", ["raw angle", "adc", "angle (12-bit)", "ADC_value", "Winkel raw"])
def test_counts_of_a_converter_are_asked_about(title: str, tmp_path: Path) -> None:
    text = table(f"t,{title}", TIME, TURNED)
    with pytest.raises(RecordingError, match="a count of a converter; give the size of one count: scale=360/4096"):
        read(tmp_path, text)
    found = read(tmp_path, text, scale=360 / 4096, unit="deg")
    np.testing.assert_allclose(found.angle - math.pi, ANGLE, atol=STEP)


@pytest.mark.parametrize(("text", "bits"), [
    (table("t,AS5600 angle", TIME, TURNED), 12), ("# AS5600 on pin A4\n" + table("t,angle", TIME, TURNED), 12),
    (table("t,AS5048 raw", TIME, np.round(8192 + ANGLE / (2.0 * math.pi) * 16384)), 14)])
def test_an_encoder_that_is_named_gives_the_size_of_its_counts(text: str, bits: int, tmp_path: Path) -> None:
    found = read(tmp_path, text)
    np.testing.assert_allclose(found.angle - math.pi, ANGLE, atol=STEP)
    assert f"unit: deg, as the title names an encoder of {2**bits} counts a turn" in found.notes


def test_whole_numbers_that_may_be_counts_or_degrees_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"are whole numbers up to 2.*, which may be a count of a converter or"):
        read(tmp_path, table("t,angle", TIME, TURNED))
    whole = np.round(180.0 + np.degrees(ANGLE))
    text = "# AS5600\n" + table("t,angle", TIME, whole)
    with pytest.raises(RecordingError, match="whole numbers below 360, which may be degrees or counts of the encoder"):
        read(tmp_path, text)
    for found in (read(tmp_path, text, unit="deg"), read(tmp_path, table("t,angle", TIME, whole))):
        np.testing.assert_allclose(np.degrees(found.angle), whole, atol=1e-9)


# --- all ------------------------------------------------------------------------------------------------------------

WHOLE: dict[str, tuple[str, bytes]] = {
    "Logger Pro": ("swing.cmbl", cmbl(Latest=[(name, unit, cells[:40]) for name, unit, cells in LATEST]).encode()),
    "MATLAB": ("swing.mat", mat(t=TIME[:40], theta=ANGLE[:40])),
    "MATLAB, compressed": ("swing.mat", mat(t=TIME, theta=ANGLE, options={"do_compression": True})),
    "MATLAB 4": ("swing.mat", mat(t=TIME[:40], theta=ANGLE[:40], options={"format": "4"})),
    "NumPy": ("swing.npz", npz(t=TIME[:40], theta=ANGLE[:40])), "NumPy array": ("swing.npy", npy(TIME)),
    "phyphox": ("swing.phyphox", phyphox({"gyr_time": init(TIME[:40]), "gyrX": init(RATE[:40])},
                                         f"<set name='a'>{GYROSCOPE}</set>").encode()),
    "micro:bit": ("MY_DATA.HTM", my_data(table("Time (seconds),a", TIME[:40], ANGLE[:40]))[:0x3000]),
}


@pytest.mark.quick("MATLAB, compressed", "NumPy", "Logger Pro")
@pytest.mark.parametrize("kind", WHOLE)
def test_a_damaged_file_has_one_error(kind: str, tmp_path: Path) -> None:
    """Whatever decoder fails: a text, or RecordingError with the file's name in one line, and never anything else."""
    name, data = WHOLE[kind]
    (tmp_path / name).write_bytes(data)
    assert text_of(str(tmp_path / name))[0]
    source = random.Random(kind)
    for _ in range(150):
        (tmp_path / name).write_bytes(damaged(data, source))
        why = ""
        try:
            text_of(str(tmp_path / name))
        except RecordingError as error:
            why = str(error)
        assert not why or why.startswith(str(tmp_path / name))
        assert "\n" not in why


@pytest.mark.slow
def test_an_array_that_unpacks_to_too_much_is_refused(tmp_path: Path) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("t.npy", npy(np.zeros(1))[:128] + bytes(300_000_000))
    with pytest.raises(RecordingError, match="at most 268435456 bytes, found more"):
        read(tmp_path, file.getvalue(), "swing.npz")


def test_every_format_says_what_it_refuses_or_how_a_part_is_chosen() -> None:
    assert all("refused: " in one.reading or "part=" in one.reading for one in FORMATS)
    unseen = {one.name for one in FORMATS if "never seen from a real device" in one.reading}
    assert unseen == {"Logger Pro", "phyphox with data", "micro:bit log"}
