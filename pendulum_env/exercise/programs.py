"""The programs behind the report's figures: one Python file for each part, which needs only NumPy and Matplotlib.

The loops are those that :func:`pendulum_env.engine.code.loop_functions` writes for a method, as ``lab-pendulum code``
does; the templates in ``texts/programs`` hold what a student writes around them. A program computes the numbers of the
report, prints them and writes them as CSV, and draws the part's figures. It says by its file's name to which part it
belongs.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from integrators import METHODS, Method
from pendulum_env.common.version import software
from pendulum_env.exercise.figures import ENDS, LOWEST, SIGN, STRIP, WIDTH, Labels, colour, recording_label, spans
from pendulum_env.exercise.given import Given
from pendulum_env.exercise.large_angles import AMPLITUDES, PERIODS, Series
from pendulum_env.exercise.motion import STEP, ExerciseMotion, times
from pendulum_env.exercise.recorded import FIRST_SWINGS
from pendulum_env.exercise.worked import Worked
from pendulum_env.lab.measures import crossings
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.turning import CLEAR
from pendulum_env.physics.effects import Gravity, LinearDrag
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.plots.motion import EXACT
from pendulum_env.render.palette import OKABE_ITO

if TYPE_CHECKING:
    from jinja2 import Environment

NEXT_LINE = ",\n         "
"""What stands between the rows of a list that is set by ``parts = [``."""
SAME = 1e-9
"""Largest relative difference of a period by the program's crossings from the report's; gaps make larger ones."""


def program_names(worked: Worked) -> tuple[str, ...]:
    """Return the file names of the programs of a worked exercise, in the report's order.

    That of 1.1 is left out without a recording, and where readings are missing in its first oscillations, which the
    report counts and the program does not.
    """
    sheet = worked.given.sheet
    first = () if worked.given.simulated or not same_period(sheet.recording, sheet.oscillations,
                                                            sheet.period.value) else ("1_1",)
    by_hand = [f"3_{name}" for name in ("lengths", "kater") if getattr(worked.given, name) is not None]
    parts = (*first, "1_2", "1_4", "2_1", "2_2", "2_3", "2_4", "2_5", "2_6", *by_hand)
    return tuple(f"part_{part}.py" for part in parts)


def programs(worked: Worked, labels: Labels, templates: Environment) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of every program; ``templates`` is an environment of the report's templates."""
    templates = templates.overlay(autoescape=False)
    templates.filters = {**templates.filters, "py": lambda text: json.dumps(text, ensure_ascii=False)}
    given = values(worked, labels)
    for name in program_names(worked):
        stem = name.removesuffix(".py")
        template = "part_2_6_by_hand.py" if stem == "part_2_6" and worked.recorded.by_hand is not None else name
        text = templates.get_template(f"programs/{template}.j2").render(
            file=name, stem=stem, software=software(), labels=labels, width=WIDTH, strip=STRIP, lowest=LOWEST,
            sign=SIGN, grey=EXACT["color"], blue=OKABE_ITO["blue"], first_swings=FIRST_SWINGS, dt=STEP,
            colours={one: colour(one) for one in worked.small.runs}, simulated=worked.given.simulated,
            recording_label=recording_label(worked, labels), by_hand=worked.given.amplitudes is not None, **given[stem],
        )
        yield name, text.lstrip()


def data_tables(worked: Worked) -> Iterator[tuple[str, tuple[str, ...], tuple[Any, ...]]]:
    """Yield name, titles and columns of the tables of readings that the programs start from."""
    swing, points = worked.given.sheet.recording, worked.recorded.points
    if not worked.given.simulated:
        yield "readings.csv", ("time_s", "angle_rad"), (swing.time, swing.angle)
    if worked.given.amplitudes is None:
        yield ("half_swings.csv", ("time_s", "amplitude_rad", "error_rad"),
               (points.time, points.amplitude, points.error))


def same_period(series: Any, cycles: int, period: float) -> bool:
    """Return True if the mean of ``cycles`` oscillations between a series' crossings is a period [s]."""
    found = crossings(series.time, series.angle, level=level_of(series))
    return len(found) > cycles and abs((found[cycles] - found[0]) / cycles / period - 1.0) < SAME


def level_of(series: Any) -> float:
    """Return the angle [rad] beyond which a series is clearly on one side."""
    return CLEAR * noise_level(series.time, series.angle)


def values(worked: Worked, labels: Labels) -> dict[str, dict[str, Any]]:
    """Return what the templates of the programs take, by the program's name: numbers, and the source of the loops."""
    from pendulum_env.engine.code import is_plain, loop_functions

    given, small, large, friction = worked.given, worked.small, worked.large, worked.recorded
    compared, damped, fine = friction.compared, friction.damped, friction.fine
    linear = SCENES["exercise"]
    free = SCENES["exercise_large"].with_effects((Gravity(),))
    lossy = SCENES["exercise_large"].with_effects((Gravity(), LinearDrag(gamma=1.0)))
    own = worked.own if worked.own is not None and is_plain(worked.own) else None
    methods: dict[str, Method] = {name: METHODS[name] for name in small.runs if name in METHODS}
    methods |= {} if own is None else {own.name: own}

    def loops(scene: Scene, chosen: Mapping[str, Method]) -> str:
        return "\n".join(loop_functions(scene, chosen))

    forward, symplectic = ({name: METHODS[name]} for name in ("forward_euler", "symplectic_euler"))
    start = {"omega": repr(small.omega), "degrees": rounded(math.degrees(small.forward.angle[0])),
             "steps": steps_of(small.forward)}
    top = {"omega": repr(small.omega), "degrees": rounded(math.degrees(large.run.angle[0]))}
    whole, end = compared.time[-1], ENDS * compared.period_recorded
    model = {"recording": Series(compared.time, compared.recorded), "simulation": compared.model}
    periods = {"recording": compared.period_recorded, "simulation": compared.period_simulated}
    same = all(same_period(model[who], compared.cycles, periods[who]) for who in model)
    return {
        "part_1_1": {"sheet": given.sheet, "level": repr(level_of(given.sheet.recording)),
                     "amplitude": repr(given.amplitude)},
        "part_1_2": {**start, "loops": loops(linear, forward)},
        "part_1_4": {**start, "loops": loops(linear, forward)},
        "part_2_1": {**start, "loops": loops(linear, methods), "methods": list(methods)},
        "part_2_2": {**top, "steps": steps_of(large.run), "loops": loops(free, symplectic),
                     "level": repr(level_of(large.run)), "parts": parts_of(large.run.time[-1], large.period)},
        "part_2_3": {**top, "steps": len(times(PERIODS * math.tau / small.omega)) - 1, "amplitudes": list(AMPLITUDES),
                     "loops": loops(free, symplectic)},
        "part_2_4": {
            "readings": rows_of(friction.readings.time, friction.readings.amplitude, friction.readings.error),
            "density": repr(friction.flows[0].scene.medium.density),
            "viscosity": repr(friction.flows[0].scene.medium.viscosity),
            "flows": [(one.whose, float(math.degrees(one.amplitude)), one.scene.omega0, one.scene.body.reach,
                       one.scene.body.radius) for one in friction.flows],
        },
        "part_2_5": {**top, "gamma": repr(max(friction.gamma.value, 0.0)), "steps": steps_of(damped),
                     "period": repr(large.period), "parts": parts_of(damped.time[-1], large.period),
                     "fine_dt": repr(fine.dt), "fine_steps": steps_of(fine), "loops": loops(lossy, symplectic)},
        "part_2_6": {
            "omega": repr(given.recorded.value.value), "gamma": repr(compared.gamma),
            "theta": repr(float(compared.model.angle[0])), "steps": steps_of(compared.model),
            "loops": loops(lossy, symplectic), "cycles": compared.cycles if same else 0,
            "level": repr(level_of(model["recording"])), "model_level": repr(level_of(compared.model)),
            "parts": parts_of(whole, compared.period_recorded),
            "ends": [(0.0, float(end)), (float(whole - end), float(whole))] if whole > 2.0 * end else [
                (0.0, float(whole))],
        },
        **({} if friction.by_hand is None else {"part_2_6": {
            "omega": repr(small.omega), "gamma": repr(friction.by_hand.gamma),
            "steps": steps_of(friction.by_hand.model),
            "readings": rows_of(friction.by_hand.time, friction.by_hand.angle, friction.by_hand.error),
            "loops": loops(lossy, symplectic),
        }}),
        **tables_by_hand(given),
    }


def tables_by_hand(given: Given) -> dict[str, dict[str, Any]]:
    """Return what the templates of tables by hand take: periods against lengths, timings of a reversible pendulum."""
    found: dict[str, dict[str, Any]] = {}
    if (lines := given.lengths) is not None:
        found["part_3_lengths"] = {"rows": rows_of(lines.length + lines.size, lines.period, lines.error)}
    if (swung := given.kater) is not None:
        found["part_3_kater"] = {"rows": rows_of(swung.position, swung.first, swung.second),
                                 "edges": repr(swung.edges.value), "degree": swung.degree}
    return found


def rows_of(*columns: Any) -> list[list[float]]:
    """Return the rows of columns of numbers."""
    return [[float(x) for x in row] for row in zip(*columns, strict=True)]


def rounded(number: float) -> str:
    """Return the shortest text of a number within rounding of it: 5.0 for 5.000000000000001."""
    return repr(float(f"{number:.12g}"))


def steps_of(run: ExerciseMotion) -> int:
    """Return the number of steps of a run."""
    return len(run.time) - 1


def parts_of(end: float, period: float) -> str:
    """Return the source of the parts of the time [s] that the strips of a figure show, three in a line."""
    parts = [f"({rounded(first)}, {rounded(last)})" for first, last in spans(float(end), period)]
    rows = [", ".join(parts[k : k + 3]) for k in range(0, len(parts), 3)]
    return f"[{NEXT_LINE.join(rows)}]"
