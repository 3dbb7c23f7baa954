"""Speed of the page: its first swing, steps per second of every method beside compiled Python, the script of a frame.

Needs playwright (`pip install -e ".[test]"`) and a Chromium on the path. A browser computes 200 000 steps of `vacuum`
in pieces of 500, with energies, Python as many in one compiled call; each number is the best of five. The frame has
four pendulums and all plots at 1400 x 1000 pixels, drawn in software; the time is that of the scripts, mean and 95 % of
300 in a row, first as the page begins, then with ruler, protractor and all arrows. In every frame a quarter of the
plots is drawn. The first swing is the first frame in which the pendulums have moved, since the navigation; median and
largest of five.
"""

from __future__ import annotations

import shutil
import statistics
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from machine import describe
from playwright.sync_api import sync_playwright

from pendulum_env import SCENES
from pendulum_env.engine.machine import Machine
from pendulum_env.web import write
from pendulum_env.web.document import SHOWN_METHODS

STEPS, PIECE, REPEATS, FRAMES = 200_000, 500, 5, 300
STEPPED = """
([method, steps, piece, repeats]) => {
  const { Machine, lab } = LabPendulum;
  let best = Infinity;
  for (let repeat = 0; repeat < repeats; repeat += 1) {
    const machine = new Machine("vacuum", method, lab.lanes[0].values, 0.01, 1, 0);
    const begun = performance.now();
    for (let left = steps; left > 0; left -= piece) machine.take(1, piece, 0);
    best = Math.min(best, performance.now() - begun);
  }
  return best / steps * 1e6;
}
"""
DRAWN = """
(frames) => {
  const { lab, advance, show } = LabPendulum;
  const times = [];
  for (let frame = 1; frame <= frames; frame += 1) {
    const begun = performance.now();
    advance(frame / 60);
    show(1e9 + (1000 / 60) * frame);
    times.push(performance.now() - begun);
  }
  return times;
}
"""
MOVED = """
(() => {
  const look = () => {
    if (globalThis.LabPendulum?.lab.time > 0) globalThis.moved = performance.now();
    else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})();
"""
ALL_ON = """
() => {
  for (const box of document.querySelectorAll("#shown input")) if (!box.checked) box.click();
  document.getElementById("restart").click();
}
"""
LINK = "v=1&scene=driven&methods=rk4:0.01,velocity_verlet:0.01,dop853:0.02,gauss4:0.02&angle=2&velocity=0"


def in_python(method: str) -> float:
    """Return the time of a compiled step [ns]."""
    machine = Machine(SCENES["vacuum"], method)
    best = float("inf")
    for _ in range(1 + REPEATS):
        state = machine.state(1.0, 0.0)
        begun = time.perf_counter()
        machine.advance(state, 0.0, 0.01, STEPS)
        best = min(best, time.perf_counter() - begun)
    return best / STEPS * 1e9


def main() -> None:
    browser_file = shutil.which("chromium") or shutil.which("google-chrome")
    with TemporaryDirectory() as folder, sync_playwright() as driver:
        file = write(Path(folder) / "lab.html")
        browser = driver.chromium.launch(executable_path=browser_file, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_context(viewport={"width": 1400, "height": 1000}, reduced_motion="reduce").new_page()
        print(f"{describe()}, Chromium {browser.version}; the file has {file.stat().st_size / 1e3:.0f} kB")
        moved = []
        for _ in range(REPEATS):
            first = browser.new_page(viewport={"width": 1400, "height": 1000})
            first.add_init_script(MOVED)
            first.goto(file.as_uri())
            first.wait_for_function("globalThis.moved")
            moved.append(first.evaluate("moved"))
            first.close()
        print(f"first swing: {statistics.median(moved) / 1e3:.2f} s after opening, largest of {REPEATS} "
              f"{max(moved) / 1e3:.2f} s (goal 1 s)")
        page.goto(f"{file.as_uri()}#v=1&scene=vacuum&methods=rk4:0.01")
        page.wait_for_function("/checked \\(/.test(document.getElementById('check').textContent)")
        for method in SHOWN_METHODS:
            there, here = page.evaluate(STEPPED, [method, STEPS, PIECE, REPEATS]), in_python(method)
            print(f"{method:18s} {1e3 / there:8.2f} million steps a second, {there:7.1f} ns; compiled Python "
                  f"{here:7.1f} ns, ratio {there / here:.2f}")
        page.goto("about:blank")
        page.goto(f"{file.as_uri()}#{LINK}")
        page.wait_for_function("/checked \\(/.test(document.getElementById('check').textContent)")
        for what in ("as it begins", "with ruler, protractor and all arrows"):
            times = sorted(page.evaluate(DRAWN, FRAMES))
            print(f"script of a frame, four pendulums and all plots, {what}: mean {statistics.mean(times):.1f} ms, "
                  f"95 % below {times[int(0.95 * FRAMES)]:.1f} ms (goal 4 ms)")
            page.evaluate(ALL_ON)
        browser.close()


if __name__ == "__main__":
    main()
