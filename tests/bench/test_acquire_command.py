"""The command ``lab-pendulum acquire`` without a page: progress, Ctrl-C, lost sources, refusals, options of sources."""

from __future__ import annotations

import math
import os
import pty
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_clock import BenchClock
from command_line import Here

from pendulum_env import Recording
from pendulum_env.bench import SOURCES
from pendulum_env.bench.source import settings_of
from pendulum_env.lab.simulated import FILE


def test_a_run_is_written_and_said(run_here: Here, tmp_path: Path, bench_clock: BenchClock) -> None:
    code, printed, said = run_here("acquire", "--headless", "--duration", "3", "--angle", "-20", "--noise", "0",
                                   "--rate", "50", "--out", "swing.csv")
    assert (code, said) == (0, "")
    assert "Wrote swing.csv: 151 samples in 3 s, none lost." in printed
    assert "lab-pendulum fit swing.csv fits it" in printed
    recording = Recording.read(tmp_path / "swing.csv")
    assert np.degrees(recording.angle[0]) == pytest.approx(-20.0, abs=0.05)
    source = f"# source: Virtual(angle={math.radians(-20.0)!r}, rate=50.0, noise=0.0)\n"
    assert source in (tmp_path / "swing.csv").read_text()


def test_files_are_numbered_and_never_replaced(run_here: Here, tmp_path: Path, bench_clock: BenchClock) -> None:
    short = ("acquire", "--headless", "--duration", "0.1")
    assert [run_here(*short)[0] for _ in range(3)] == [0, 0, 0]
    assert sorted(os.listdir(tmp_path)) == ["swing-2.csv", "swing-3.csv", "swing.csv"]
    before = (tmp_path / "swing.csv").read_bytes()
    code, _, said = run_here(*short, "--out", "swing.csv")
    assert (code, said) == (2, "Error: swing.csv exists already; choose another name, or replace it by --force\n")
    assert (tmp_path / "swing.csv").read_bytes() == before
    assert run_here(*short, "--out", "swing.csv", "--force", "--rate", "20")[0] == 0
    assert len(Recording.read(tmp_path / "swing.csv").time) == 3


@pytest.mark.parametrize("headless", [(), ("--headless",)])
def test_a_folder_that_cannot_be_is_refused_before_anything_opens(
    headless: tuple[str, ...], run_here: Here, tmp_path: Path,
) -> None:
    (tmp_path / "file").write_text("kept")
    assert run_here("acquire", *headless, "--from", "replay:none.csv", "-o", "file/a.csv") == (
        2, "", "Error: The output folder file cannot be written: Not a directory.\n")
    assert os.listdir(tmp_path) == ["file"]


def test_zero_and_direction(run_here: Here, tmp_path: Path, bench_clock: BenchClock) -> None:
    assert run_here("acquire", "--headless", "--duration", "0.5", "--angle", "20", "--noise", "0", "--reverse",
                    "--out", "a.csv")[0] == 0
    assert np.degrees(Recording.read(tmp_path / "a.csv").angle[0]) == pytest.approx(-20.0, abs=0.05)
    assert run_here("acquire", "--headless", "--duration", "0.5", "--angle", "20", "--noise", "0", "--zero",
                    "--out", "b.csv")[0] == 0
    assert Recording.read(tmp_path / "b.csv").angle[0] == pytest.approx(0.0, abs=1e-9)


REFUSED = {
    "--from udb:5005": "There is no source 'udb:5005'; did you mean udp?",
    "--from udp": "udp needs an address, as udp:PORT",
    "--from virtual --speed 2": "virtual has no option --speed",
    "--from replay:swing.txt --unit deg": "replay has no option --unit; there are speed.",
    "--from replay:nowhere.txt": "nowhere.txt",
    "--scene labb": "did you mean lab",
    "--integrators rk44": "did you mean rk4",
    "--from udp:5005 --scene lab": "udp has no option --scene",
    "--from udp:5005 --unit degree": "did you mean deg",
    "--duration 0": "duration must be a finite number above 0",
    "--angle high": "is not a number",
    "--seed 1.5": "is not a whole number",
    "--out .": "is a folder; give a file's name",
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_cannot_be_done_is_refused_by_a_sentence_and_leaves_no_file(
    words: str, run_here: Here, tmp_path: Path
) -> None:
    code, printed, said = run_here("acquire", "--headless", *words.split())
    assert code == 2
    assert REFUSED[words] in " ".join(re.sub("[│╭╮╰╯─]", " ", printed + said).split())
    assert "Traceback" not in said
    assert os.listdir(tmp_path) == []


def test_options_of_the_page_and_of_a_run_are_told_apart(run_here: Here) -> None:
    assert "--duration is for --headless" in run_here("acquire", "--duration", "3")[2]
    assert "--reverse is for --headless" in run_here("acquire", "--reverse")[2]


def test_the_help_has_every_setting_of_every_source(run_here: Here) -> None:
    _, printed, _ = run_here("acquire", "--help")
    for name, kind in SOURCES.items():
        assert name == kind.name
        assert kind.form() in printed
        assert kind.about in " ".join(printed.split())
        for option in settings_of(kind):
            option = {"integrator": "integrators"}.get(option, option)  # the commands' common option of one or more
            assert f"--{option.replace('_', '-')} " in printed


def test_a_source_that_is_lost_keeps_what_came(run_here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pendulum_env.bench.source import SourceError
    from pendulum_env.bench.sources.virtual import Virtual

    real, reads = Virtual.read, iter(range(10**6))

    def pulled(self: Virtual, timeout: float = 0.1) -> Any:
        if next(reads) > 20:
            raise SourceError("the cable was pulled; plug it in again")
        return real(self, timeout)

    monkeypatch.setattr(Virtual, "read", pulled)
    code, printed, said = run_here("acquire", "--headless", "--out", "swing.csv")
    assert code == 2
    assert "Wrote swing.csv: " in printed
    assert said == "Error: the run ended early: the cable was pulled; plug it in again\n"
    assert len(Recording.read(tmp_path / "swing.csv").time) >= 15


def test_a_replay_runs_to_its_end(run_here: Here, tmp_path: Path, bench_clock: BenchClock) -> None:
    code, printed, _ = run_here("acquire", "--from", f"replay:{FILE}", "--headless", "--speed", "4", "--out", "a.txt")
    assert code == 0
    assert "speed: 4 times the true one" in printed
    first, again = Recording.read(FILE), Recording.read(tmp_path / "a.txt")
    np.testing.assert_allclose(again.time, first.time - first.time[0], atol=1e-6)
    np.testing.assert_allclose(again.angle, first.angle, atol=1e-9)
    assert "speed: 4 times the true one; times are those of the file" in again.notes


def test_ctrl_c_ends_a_run_that_is_complete(
    run_here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bench_clock: BenchClock
) -> None:
    from pendulum_env.bench.sources.virtual import Virtual

    real, reads = Virtual.read, iter(range(10**6))

    def interrupted(self: Virtual, timeout: float = 0.1) -> Any:
        if next(reads) > 500:
            raise KeyboardInterrupt
        return real(self, timeout)

    monkeypatch.setattr(Virtual, "read", interrupted)
    code, printed, said = run_here("acquire", "--headless", "--out", "swing.csv")
    assert (code, said) == (0, "")
    assert f"Wrote swing.csv: {len(Recording.read(tmp_path / 'swing.csv').time)} samples in" in printed


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals and signals differ")
def test_ctrl_c_keeps_what_came_and_a_terminal_shows_progress(tmp_path: Path) -> None:
    """Through a pseudo-terminal of 80 columns, with a device that sends datagrams for as long as it runs."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    over = threading.Event()

    def device() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            for i in range(6000):
                one.sendto(f"{10 * i}\t{12.5 - 0.1 * i:.2f}\n".encode(), ("127.0.0.1", port))
                if over.wait(0.01):
                    return

    sender = threading.Thread(target=device)
    sender.start()
    main, other = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "pendulum_env", "acquire", "--from", f"udp:{port}", "--headless", "--out", "swing.csv"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=other, env={**os.environ, "COLUMNS": "80"},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    os.close(other)
    path, until = tmp_path / "swing.csv", time.monotonic() + 60.0
    try:
        while not path.exists() or path.stat().st_size < 1500:
            assert time.monotonic() < until
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        printed, _ = process.communicate(timeout=60)
    finally:
        over.set()
        sender.join()
        process.kill()
    shown = b""
    try:
        while part := os.read(main, 65536):
            shown += part
    except OSError:  # the end of a pseudo-terminal
        pass
    os.close(main)
    assert process.returncode == 0
    found = re.fullmatch(r"Wrote swing\.csv: (\d+) samples in ([\d.]+) s, (\w+) lost\.",
                         printed.decode().splitlines()[0])
    assert found is not None
    assert int(found[1]) == len(Recording.read(path).time) > 60
    lines = [line for line in shown.decode().split("\r") if line.strip()]
    assert all(len(line) <= 80 for line in lines)
    assert re.match(r"[\d.]+ s, \d+ samples, [\d.]+ per s, angle [+-][\d.]+°, 0 lost", lines[-1])
    assert "time: in ms, as it grows by" in printed.decode()
