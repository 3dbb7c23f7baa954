"""Interfaces of schools: their libraries in an environment that has them; channels and refusals in this one."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from beside import environment
from readme_code import ROOT

from pendulum_env.bench.background import Background, joined
from pendulum_env.bench.channels import Channel, choose
from pendulum_env.bench.source import NOTHING, Chunk, Source, SourceError
from pendulum_env.bench.sources.nidaq import Nidaq
from pendulum_env.bench.sources.pasco import Pasco
from pendulum_env.bench.sources.vernier import Vernier

LIBRARIES = {"vernier": "godirect>=1.2.1", "pasco": "pasco>=0.3.65", "nidaq": "nidaqmx>=1.0"}


@pytest.fixture(scope="session")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment with the package and the libraries."""
    return environment(tmp_path_factory, "interfaces", *LIBRARIES.values())


@pytest.mark.slow
@pytest.mark.parametrize("source", LIBRARIES)
def test_source_in_an_environment_that_has_its_library(foreign: Path, source: str) -> None:
    if source == "pasco" and sys.version_info < (3, 11):
        pytest.skip("PASCO's library needs Python 3.11")
    checks = Path(__file__).with_name(f"{source}_checks.py")
    done = subprocess.run([foreign, "-m", "pytest", "-q", "-p", "no:cacheprovider", checks], cwd=ROOT,
                          capture_output=True, text=True, env={**os.environ})
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"^\d+ passed in", done.stdout, flags=re.M), done.stdout


def test_every_interface_has_checks_and_an_extra() -> None:
    assert {path.name.removesuffix("_checks.py") for path in Path(__file__).parent.glob("*_checks.py")} == {*LIBRARIES}
    project = (ROOT / "pyproject.toml").read_text("utf-8")
    assert all(f'{name} = ["{library.split(">")[0]}' in project for name, library in LIBRARIES.items())


@pytest.mark.parametrize(("source", "modules", "said"), [
    (Vernier(), ["godirect"], 'vernier: needs godirect, a library under the GPL-3.0; install it with pip install '
                              '"lab-pendulum[vernier]"'),
    (Pasco(), ["pasco", "pasco.pasco_ble_device"],
     "pasco: needs pasco, a library under a licence of PASCO's own; install it with pip install "
     '"lab-pendulum[pasco]"'),
    (Nidaq("Dev1/ctr0", counts=4000), ["nidaqmx"],
     'nidaq: needs nidaqmx; install it with pip install "lab-pendulum[nidaq]", and the driver NI-DAQmx from ni.com'),
])
def test_a_missing_library_is_told_with_the_extra_that_brings_it(source: Source, modules: list[str], said: str,
                                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    if isinstance(source, Pasco) and sys.version_info < (3, 11):
        said = "pasco: its library needs Python 3.11 or newer; run LabPendulum with that"
    for name in modules:  # even where it is installed
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(SourceError) as refused:
        source.open()
    source.close()
    source.close()
    assert str(refused.value) == said


@pytest.mark.parametrize(("counts", "said"), [
    (None, "nidaq needs --counts, the encoder's counts per turn: 4 times its lines, as --counts 4000 for 1000 lines"),
    (1001, "nidaq needs --counts, the encoder's counts per turn: 4 times its lines, as --counts 4000 for 1000 lines, "
           "not 1001"),
])
def test_counts_that_belong_to_no_disc_are_refused(counts: int | None, said: str) -> None:
    with pytest.raises(SourceError) as refused:
        Nidaq("Dev1/ctr0", counts=counts).open()
    assert str(refused.value) == said
    with pytest.raises(SourceError, match=r"^nidaq needs a counter, as nidaq:Dev1/ctr0$"):
        Nidaq().open()


def channels(*named: tuple[str, str]) -> list[Channel]:
    return [Channel(number, name, unit) for number, (name, unit) in enumerate(named)]


@pytest.mark.parametrize(("offered", "wanted", "quantity", "columns"), [
    ([("Position", "m"), ("Angle", "rad"), ("Angle", "°"), ("Angular velocity", "rad/s")], None, "angle",
     ("Angle (rad)",)),
    ([("Temperature", "°C"), ("Angle", "°")], None, "angle", ("Angle (deg)",)),
    ([("X-axis acceleration", "m/s²"), ("Angle", "°"), ("Z-axis gyro", "rad/s")], None, "rate",
     ("Angular velocity z (rad/s)",)),
    ([("X-axis acceleration", "m/s²"), ("Angle", "°"), ("Z-axis gyro", "rad/s")], "angle", "angle", ("Angle (deg)",)),
    ([("Angular acceleration", "rad/s²"), ("Angular velocity", "rad/s")], None, "rate", ("Angular velocity (rad/s)",)),
    ([("AngularVelocityx", "degps"), ("AngularVelocityy", "degps")], None, "rate",
     ("Angular velocity x (deg/s)", "Angular velocity y (deg/s)")),
    ([("Accelerationx", "ms2"), ("Accelerationz", "ms2"), ("AccelerationResultant", "ms2"), ("TiltAngleX", "deg")],
     None, "force", ("Acceleration x (m/s^2)", "Acceleration z (m/s^2)")),
    ([("X-axis acceleration", "g"), ("X-axis acceleration high", "g")], None, "force", ("Acceleration x (g)",)),
])
def test_the_channels_of_a_swing_are_found(offered: list[tuple[str, str]], wanted: str | None, quantity: str,
                                           columns: tuple[str, ...]) -> None:
    chosen = choose("a device", channels(*offered), wanted)
    assert (chosen.quantity, chosen.columns) == (quantity, columns)


@pytest.mark.parametrize(("offered", "wanted", "said"), [
    ([], None, "a device measures no angle, angular velocity or acceleration in a known unit, but no channel"),
    ([("Angle", "furlong"), ("Force", "N")], None, "but Angle (furlong), Force (N); connect a rotary motion sensor"),
    ([("Linear acceleration x", "m/s²")], None, "but Linear acceleration x (m/s²)"),
    ([("Angle", "rad")], "angel", "a device has no channel 'angel'; did you mean Angle?"),
])
def test_devices_without_a_channel_of_a_swing_are_refused(offered: list[tuple[str, str]], wanted: str | None,
                                                          said: str) -> None:
    with pytest.raises(SourceError, match=re.escape(said)):
        choose("a device", channels(*offered), wanted)


def test_samples_that_came_before_an_error_are_read_before_it() -> None:
    steps = iter([Chunk(NOTHING.values, lost=2), Chunk(NOTHING.values.copy().reshape(0, 1), lost=1)])

    def step() -> Chunk:
        try:
            return next(steps)
        except StopIteration:
            raise SourceError("gone") from None

    ended: list[bool] = []
    thread = Background(lambda: None, step, lambda: ended.append(True))
    thread.open()
    lost = 0
    with pytest.raises(SourceError, match="gone"):  # noqa: PT012
        while True:
            lost += thread.read(0.1).lost
    thread.close()
    assert lost == 3
    assert ended == [True]
    assert joined([NOTHING, Chunk(NOTHING.values, lost=4)]).lost == 4
