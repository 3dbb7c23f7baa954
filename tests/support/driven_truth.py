"""Simulated logs of driven pendulums, with an equation of motion of their own: nothing here comes from the package.

``theta'' = -stiffness sin(theta) - viscous theta' - dry sign(theta') + drive s(t)``, where s follows a command u that
is held between the ticks of a clock, by ``lag s' = u(t - delay) - s``. Friction sticks: at rest it balances all other
torques up to ``dry``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

MARGIN = 1.0
"""Part at the start of a log that is simulated and not recorded [s], so that lag and delay have forgotten their start.
"""


def motion(truth: dict[str, float], command: np.ndarray, tick: float, fine: int) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and torque share s at every fine step, by classical Runge-Kutta steps of ``tick / fine``.

    The angle starts at rest at 0. A zero of the velocity within a step is located to second order. The delay is rounded
    to fine steps: draw one that is a multiple of them.
    """
    k, b, dry, gain = (truth[name] for name in ("stiffness", "viscous", "dry", "drive"))
    lag, late = truth["lag"], round(truth["delay"] / tick * fine)
    h, count = tick / fine, len(command) * fine
    held = np.repeat(command, fine)
    held = np.concatenate([np.full(late, command[0]), held])[:count].tolist()
    fade = math.exp(-h / lag) if lag else 0.0
    q, v, s = 0.0, 0.0, held[0]
    angles, shares = np.empty(count + 1), np.empty(count + 1)
    sin = math.sin
    for i in range(count):
        angles[i], shares[i] = q, s
        after = held[i] + (s - held[i]) * fade if lag else held[i]
        middle = 0.5 * (s + after) if lag else after
        first = s if lag else after
        pull = -k * sin(q) + gain * first
        if v == 0.0 and abs(pull) <= dry:
            s = after
            continue
        side = math.copysign(dry, v if v else pull)
        a1 = -k * sin(q) - b * v - side + gain * first
        v2 = v + 0.5 * h * a1
        a2 = -k * sin(q + 0.5 * h * v) - b * v2 - side + gain * middle
        v3 = v + 0.5 * h * a2
        a3 = -k * sin(q + 0.5 * h * v2) - b * v3 - side + gain * middle
        v4 = v + h * a3
        a4 = -k * sin(q + h * v3) - b * v4 - side + gain * after
        new = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if dry and v * new < 0.0:  # it comes to rest within the step, and then stays there or turns back
            before = h * v / (v - new)
            q += 0.5 * before * v
            pull = -k * sin(q) + gain * s
            v = 0.0 if abs(pull) <= dry else (h - before) * (pull - math.copysign(dry, pull))
            q += 0.5 * (h - before) * v
        else:
            q, v = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), new
        s = after
    angles[count], shares[count] = q, s
    return angles, shares


def by_scipy(truth: dict[str, float], command: np.ndarray, tick: float) -> np.ndarray:
    """Return the angle at every tick for a pendulum without dry friction and delay, by scipy's DOP853."""
    from scipy.integrate import solve_ivp

    k, b, gain, lag = (truth[name] for name in ("stiffness", "viscous", "drive", "lag"))
    state, angles = np.zeros(3), [0.0]
    for u in command:
        run = solve_ivp(lambda t, y, u=u: (y[1], -k * math.sin(y[0]) - b * y[1] + gain * y[2], (u - y[2]) / lag),
                        (0.0, tick), state, method="DOP853", rtol=1e-10, atol=1e-12)
        state = run.y[:, -1]
        angles.append(float(state[0]))
    return np.array(angles)


def steps(source: np.random.Generator, duration: float, tick: float, size: float, hold: float) -> np.ndarray:
    """Return a command of random steps within ``±size``, each held for 0.3 to 1.5 times ``hold`` [s]."""
    values: list[float] = []
    while len(values) * tick < duration:
        values += [float(source.uniform(-size, size))] * max(1, round(hold * source.uniform(0.3, 1.5) / tick))
    return np.array(values[: round(duration / tick)])


def drawn(seed: int, kind: str, **fixed: float) -> dict[str, float]:
    """Draw the truth of a bench: numbers of the equation of motion, sensor, and what is recorded."""
    source = np.random.default_rng([seed, len(kind)])
    length = source.uniform(0.15, 1.0)
    k = 9.81 / length
    period = math.tau / math.sqrt(k)
    truth = {
        "stiffness": k, "viscous": source.uniform(0.01, 0.1) * math.sqrt(k), "dry": source.uniform(0.005, 0.05) * k,
        "drive": source.uniform(0.4, 1.0) * k, "lag": source.uniform(0.015, 0.06) * period,
        "delay": source.uniform(0.005, 0.03) * period, "zero": source.uniform(-0.05, 0.05),
        "mass": source.uniform(0.05, 1.0), "quantum": math.tau / float(source.choice([1024, 2048, 4096, 8192])),
        "noise": source.uniform(0.0, 0.003), "rate": source.uniform(60.0, 200.0) / period,
        "duration": source.uniform(8.0, 16.0) * period, "torque_noise": 0.0,
    }
    if kind == "torque":
        truth |= {"delay": -source.uniform(0.0, 0.02) * period,
                  "torque_noise": source.uniform(0.02, 0.15)}
    truth |= fixed
    fine = fine_steps(truth) * truth["rate"]
    return {**truth, "delay": round(truth["delay"] * fine) / fine}


def fine_steps(truth: dict[str, float]) -> int:
    """Return the number of steps of the simulation between two readings."""
    return max(4, math.ceil(math.sqrt(truth["stiffness"]) / math.tau / truth["rate"] / 2.5e-4))


def recorded(truth: dict[str, float], seed: int, kind: str, size: float = 0.5) -> dict[str, np.ndarray]:
    """Return the arrays time, angle, velocity and drive of a log.

    For the kind "action" the drive is the command. For "torque" it is the torque that acts, recorded late by minus the
    delay, with white noise of ``torque_noise`` times the largest torque. The torque follows the command by the lag.
    """
    source = np.random.default_rng([seed, len(kind), 1])
    tick = 1.0 / truth["rate"]
    period = math.tau / math.sqrt(truth["stiffness"])
    fine = fine_steps(truth)
    command = steps(source, truth["duration"] + MARGIN, tick, size, 0.4 * period)
    acting = truth if kind == "action" else {**truth, "delay": 0.0}
    angle, share = motion(acting, command, tick, fine)
    place = np.arange(len(command)) * fine
    begin = round(MARGIN / tick)
    true = angle[place][begin:]
    read = true + truth["zero"] + truth["noise"] * source.standard_normal(len(true))
    quantum = truth["quantum"]
    read = quantum * np.round(read / quantum) if quantum else read
    velocity = np.gradient(true, tick)
    if kind == "action":
        drive = command[begin:]
    else:
        late = np.maximum(place[begin:] - round(-truth["delay"] / tick * fine), 0)
        inertia = truth["mass"] * (9.81 / truth["stiffness"]) ** 2
        torque = share[late] * truth["drive"] * inertia
        drive = torque + truth["torque_noise"] * np.abs(torque).max() * source.standard_normal(len(torque))
    return {"time": np.arange(len(read)) * tick, "angle": read, "velocity": velocity, "drive": drive}


def expected(truth: dict[str, float], kind: str) -> dict[str, float]:
    """Return the true values of the parameters that a fit of a log reports; those of an action with the mass given."""
    length = 9.81 / truth["stiffness"]
    inertia = truth["mass"] * length**2
    values = {"length": length, "moment": truth["mass"] * length, "inertia": inertia,
              "bearing_viscosity": inertia * truth["viscous"], "friction_torque": inertia * truth["dry"],
              "max_torque": inertia * truth["drive"], "delay": truth["delay"], "lag": truth["lag"],
              "zero": truth["zero"]}
    if kind == "torque":
        del values["max_torque"], values["lag"]
    return values


def text_of(log: dict[str, np.ndarray], layout: str, kind: str) -> str:
    """Return a log as the text of a file, in one of LAYOUTS."""
    titles, separator, columns = LAYOUTS[layout](log, kind)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    lines = [separator.join(titles)] if titles else []
    return "\n".join([*lines, *(separator.join(f"{x:.10g}" for x in row) for row in rows), ""])


LAYOUTS: dict[str, Any] = {
    "t, action, angle": lambda log, kind: (("t", kind, "angle"), ",", (log["time"], log["drive"], log["angle"])),
    "degrees": lambda log, kind: (
        ("Time (s)", "Angle (deg)", f"{kind.title()} {'(N m)' if kind == 'torque' else ''}".strip()), "\t",
        (log["time"], np.degrees(log["angle"]), log["drive"])),
    "bench": lambda log, kind: (
        ("time", "position", "velocity", kind), ",", (log["time"], log["angle"], log["velocity"], log["drive"])),
    "millis": lambda log, kind: (
        ("time_ms", "theta_rad", f"{kind} [{'mNm' if kind == 'torque' else '%'}]"), ";",
        (1e3 * log["time"], log["angle"], log["drive"] * (1e3 if kind == "torque" else 100.0))),
}
"""Layout of a file -> function of a log and its kind that returns titles, separator and columns."""
