"""Generated source of the loops over blocks of environments, without branches, so that they compile to SIMD code.

One array holds a block of environments (BLOCK), field after field: all angles, then all velocities, and so on. Loops
``for i in lanes(n)`` take several environments at once, and may go on to the end of a vector, where fields have room;
see :mod:`pendulum_env.engine.lanes`. Other loops are over ``range(U(n))``: from one base address and constant offsets
the compiler can prove that fields do not overlap, and unsigned indices need no check of their sign. The state of
environments that have stopped is preserved by selection, not by branches. In runs a long history of a multistep method
has changing offsets; see :class:`pendulum_env.engine.layout.Layout`.

With a tolerance every pendulum takes steps of its own. While it is within a step of h, its progress is in a *slot* of
the block's work array ``w``. Loops without branches take one attempt of an adaptive step in every slot in use, and
accept or reject it. Where a pendulum has come to the end of its step, the last slot in use moves to its slot, so that
all slots in use come first and none of them waits. Which slot a pendulum has changes no bit of its motion.
"""

from __future__ import annotations

from collections.abc import Iterable

from integrators import Method
from pendulum_env.engine import report, specialise
from pendulum_env.engine.advance import begun, checked, judged, landed, length, next_state, possible, slopes, trial
from pendulum_env.engine.goal import BEFORE
from pendulum_env.engine.layout import AHEAD, BLOCK, Layout, block_loop, side_of_turns
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.shape import (
    ADAPTED,
    DIVERGED,
    LARGEST,
    LATE,
    LOST,
    OK,
    TOO_SHORT,
    UNSURE,
    Shape,
    indent,
    joined,
)
from pendulum_env.engine.slack import next_settled
from pendulum_env.engine.source import Plain
from pendulum_env.engine.stages import TURNED, StageValue, StepStage
from pendulum_env.engine.templates import Templates

REFUSED = -1
"""Returned by a program that has found an action which is not finite."""
LOOKED = ["n = 0", "for i in range(U(size)):", "    n += 0 if abs(action[i]) < 1e999 else 1", "if n > 0:",
          f"    return {REFUSED}"]
"""Source lines that look for actions that are not finite."""
WRONG = 2**32
"""What a program adds to the number that it returns, for every reward that is not finite."""


def loops(layout: Layout, method: Method, write: Templates) -> list[str]:
    """Return the source of all loop functions of a program for many pendulums.

    With a task they advance and observe environments, without one they advance and record runs. The last of them, and
    ``starts`` of a task that draws its starts by a function, are the functions that Python calls.
    """
    first = [_remember_block(layout)] if layout.shape.remembered else []
    first += [_begin_block(layout)] if layout.shape.memory else []
    rest = [_observe(layout, write), _step_blocks(layout)] if layout.goal else [
        _record(layout, write), _run_blocks(layout)]
    adaptive = layout.shape.adaptive
    search = [_settle(layout, write)] if layout.shape.slack and not adaptive else []
    begun = [_starts(layout.goal.begin)] if layout.goal and layout.goal.begin else []
    vectors = in_vectors(method)
    steps = _adapt(layout, vectors, write) if adaptive else [_advance(layout, vectors, write)]
    return [*first, *steps, *search, *rest, *begun]


def _starts(begin: Plain) -> str:
    """Write the source of ``starts``: the starts of many episodes, by a task's own function, from random numbers."""
    return "\n".join([
        "@entry",
        "def starts(first, second, omega0, angle, velocity):",
        "    for i in range(len(first)):",
        f"        angle[i], velocity[i] = {begin.__name__}({', '.join(f'{name}[i]' for name in arguments(begin))})",
        "",
    ])


def in_stages(shape: Shape, method: Method) -> bool:
    """Return True if a block may divide a step into stages.

    It may not where a step is cut or repeated: with a tolerance, a wire that goes slack, dry friction or compensated
    sums. A closed form is not divided, because that takes the compiler half as long again, for a sixth of a step's
    time.
    """
    return not (shape.adaptive or shape.slack or shape.slides or shape.compensated or "exact_flow" in method.needs)


def in_vectors(method: Method) -> bool:
    """Return True if loops over steps of a method are written with vectors of twice a register's numbers.

    A Taylor series has more terms at once than there are registers for two of each; its loops are left to the compiler,
    which takes one.
    """
    return "taylor" not in method.needs


def _advance(layout: Layout, vectors: bool, write: Templates) -> str:
    """Write the source of ``advance_block``: one step of every environment of a block that has not stopped.

    It has one loop, or one for every stage of the step, with those that compute sines between them.
    """
    unsure = f" & (stop != {UNSURE}.0)" if layout.shape.slack else ""
    loops, calls, step = [], [], write.lines(next_state)
    for number, stage in enumerate(layout.schedule.stages):
        taken = [f"{name} = {layout.between(name)}" for name in stage.taken]
        if number == len(layout.schedule.stages) - 1:
            step = [*taken, *stage.lines, *write.lines(checked)]
            continue
        loops.append(block_loop(f"stage_{number}", joined(layout.step_arguments), layout, [
            *layout.load("index", "q", "turns", "v", *layout.shape.memory, *layout.shape.extra, sliding=True),
            *side_of_turns(layout),
            "t = index*h",
            *taken,
            *stage.lines,
            *(f"{layout.between(name)} = {name}" for name in stage.handed),
        ], vectors=vectors))
        calls.append(f"stage_{number}({joined(layout.step_arguments, layout.shared)})")
        calls += [f"{names.replace(' ', '_')}_block({given})" for names, given in _values(layout, stage)]
    lines = [
        *_state(layout),
        *(["t = index*h"] if loops else []),
        *step,
        "live = status == 0.0",
        f"good = live & (stop != {DIVERGED}.0){unsure}",
        *_kept(layout, "(1.0 if good else 0.0)"),
        f"{layout.at('status')} = stop if live else status",
    ]
    last = block_loop("advance_block", joined(layout.step_arguments), layout, lines, calls, vectors=vectors)
    back = [MOVE_BACK] if layout.histories else []
    return "\n\n".join([*_between(layout), *layout.schedule.functions, *loops, last, *back])


MOVE_BACK = f"""@separate
def move_back(s, n, last, count, away):
    for row in range(count):
        for i in range(U(n)):
            s[i + (last - U({BLOCK})*U(row))] = s[i + (last - U({BLOCK})*U(row) - away)]
"""
"""Source of ``move_back``, which moves the ``count`` fields of a history, the oldest of which belongs at ``last``, back
to their place from ``away`` numbers before it. The oldest moves first: otherwise a field would be overwritten before it
is copied."""


def _moved_back(layout: Layout, away: str, depth: int) -> list[str]:
    """Return the source lines that move all histories back to their place, by ``away`` numbers."""
    return indent([f"move_back(s, n, U({layout.fields.index(names[-1]) * BLOCK}), {len(names)}, {away})"
                   for names in layout.histories], depth)


def _values(layout: Layout, stage: StepStage) -> list[tuple[str, str]]:
    """Return the calls that compute the values after a stage: names of functions in BETWEEN, and the call's arguments.

    A sine and a cosine of one angle are computed by one call.
    """
    together: dict[tuple[str, ...], list[StageValue]] = {}
    for value in sorted(stage.values, key=lambda value: value.function):
        alike = "" if value.function in TURNED else value.function
        together.setdefault((value.argument, alike, *value.constants), []).append(value)
    calls = []
    for (argument, *_), values in together.items():
        field = argument in layout.fields
        place = layout.fields.index(argument) * BLOCK if field else layout.row(argument)
        to = [f"U({layout.row(value.name)})" for value in values]
        calls.append((" ".join(value.function for value in values),
                      joined(("s" if field else "o", "o", "n", f"U({place})"), to, values[0].constants)))
    return calls


def _between(layout: Layout) -> list[str]:
    """Write the source of the functions that compute values of a block between the stages of a step.

    They take the row of memory that begins at ``x`` in an array ``a``, and write to others in ``o``, which begin at
    ``to_sin``, for instance. Sines and cosines are computed in two loops, of which the first reduces the angles.
    """
    m, y, low = (f"o[i + U({place})]" for place in layout.reduced)
    texts = []
    for names in sorted({names for stage in layout.schedule.stages for names, _ in _values(layout, stage)}):
        functions, constants = names.split(), ("exponent",) if names == "power" else ()
        results = [f"to_{name}" for name in functions]
        if functions[0] in TURNED:
            loops = [[f"{m}, {y}, {low} = _quadrant(a[i + x])"],
                     [f"o[i + to_{name}] = {name}_reduced({m}, {y}, {low})" for name in functions]]
        else:
            loops = [[f"o[i + to_{names}] = {names}({joined(('a[i + x]',), constants)})"]]
        lines = [line for loop in loops for line in ("for i in lanes(n):", *indent(loop, 1))]
        head = f"def {'_'.join(functions)}_block({joined(('a', 'o', 'n', 'x'), results, constants)}):"
        texts.append("\n".join(["@apart", head, *indent(lines, 1), ""]))
    return texts


def _adapt(layout: Layout, vectors: bool, write: Templates) -> list[str]:
    """Write the source of ``advance_block`` for adaptive steps: one step of h of every environment that runs.

    The function makes at most ``tries`` attempts in every slot and returns the number of those that are left. The step
    is at its end if no slot is in use then; otherwise the next call continues it.
    """
    shape = layout.shape
    rates = ("a", *(f"rate_{name}" for name in shape.quadratures))
    tried = (*shape.step_results, "square")

    def load(*names: str) -> list[str]:
        """Return the source lines that assign the values of slot ``i`` to local names."""
        return [f"{name} = {layout.slot(name)}" for name in names]

    def store(*names: str, index: str = "i") -> list[str]:
        """Return the source lines that write local names to a slot."""
        return [f"{layout.slot(name, index)} = {name}" for name in names]

    begin = [
        *layout.load("index", "q", "turns", "v", "size", *layout.given),
        *side_of_turns(layout),
        "lane = i",
        "t = index*h",
        *write.lines(begun),
        *store(*(name for name in layout.under_way if name not in rates), index="U(active)"),
        "active += 1",
        f"{layout.active} = active",
    ]
    given, every = layout.given, joined(("h",), layout.shared)
    return [
        block_loop("begin_steps", "s, o, w, n, h", layout,
                   [f"if {layout.at('status')} == {OK}.0:", *indent(begin, 1)], ["active = 0"]),
        block_loop("slopes", "w, n, h", layout, [*load("t", "q", "v", *given), *write.lines(slopes), *store(*rates)]),
        block_loop("attempts", "w, n, h", layout, [
            *load("t", "done", "size", "q", "v", *rates, *given), *write.lines(length), *write.lines(trial),
            *store(*tried),
        ], vectors=vectors),
        block_loop("judgements", "w, n, h", layout, [
            *load("t", *shape.paused, *given, *tried),
            *write.lines(length),
            *write.lines(possible),
            f"if reason == {OK}.0:",
            *indent(write.lines(judged, power=specialise.name("step_power_of_many")), 1),
            *store(*shape.paused, "reason"),
        ]),
        "\n".join([
            "@inline",
            f"def landings(s, o, w, active, {every}):",
            "    for place in range(active - 1, -1, -1):",  # downwards: the last slot stays in use when it moves
            *indent([
                "i = U(place)",
                *load("done", "reason"),
                f"if done < h and reason == {OK}.0:",
                "    continue",
                *_landing(layout, write),
                "active -= 1",
                "if place < active:",
                f"    for k in range({len(layout.under_way)}):",
                f"        w[i + U({BLOCK}*k)] = w[U(active) + U({BLOCK}*k)]",
            ], 2),
            "    return active",
            "",
        ]),
        "\n".join([
            "@inline",
            f"def advance_block(s, o, w, n, tries, {every}):",
            f"    if {layout.active} == 0.0:",
            f"        begin_steps(s, o, w, n, {every})",
            f"        slopes(w, int({layout.active}), {every})",
            f"    active = int({layout.active})",
            "    while active > 0 and tries > 0:",
            f"        attempts(w, active, {every})",
            f"        judgements(w, active, {every})",
            f"        active = landings(s, o, w, active, {every})",
            "        tries -= 1",
            f"    {layout.active} = active",
            "    return tries",
            "",
        ]),
    ]


def _landing(layout: Layout, write: Templates) -> list[str]:
    """Return the source lines that end the step of the pendulum in slot ``i`` and store its state in the block."""
    shape, counts = layout.shape, (("steps", "taken"), ("vain", "rejected"))
    moved = [name for name in layout.moved if name not in layout.given]
    inside = ("t", *(name for name in shape.paused if name != "done"), *layout.given)
    return [
        *(f"{name} = {layout.slot(name)}" for name in inside),
        *(f"{short} = {long}" for short, long in (("q1", "q"), ("v1", "v"), *counts)),
        *(f"d_{name} = {name}" for name in shape.quadratures),
        *(["portion = done/h"] if shape.ends_slack else []),
        f"lane = U({layout.slot('lane')})",
        *layout.load("index", *moved, *ADAPTED[1:], "speed_limit", index="lane"),
        *write.lines(landed),
        f"if (stop != {DIVERGED}.0) & (stop != {TOO_SHORT}.0):",
        *(f"    {layout.at(name, 'lane')} = {name}1" for name in layout.moved),
        f"    {layout.at('index', 'lane')} = index + {'portion' if shape.ends_slack else '1.0'}",
        *(f"{layout.at(name, 'lane')} = {name}" for name in ADAPTED),
        f"{layout.at('status', 'lane')} = stop",
    ]


def _settle(layout: Layout, write: Templates) -> str:
    """Write the source of ``settle_block``: the step of the environments of a block in which the wire may go slack.

    They are few, and are advanced one by one.
    """
    cut = layout.shape.ends_slack
    one = [
        *_state(layout),
        *write.lines(next_settled),
        f"good = stop != {DIVERGED}.0",
        *_kept(layout, f"({'portion' if cut else '1.0'} if good else 0.0)"),
        f"{layout.at('status')} = stop",
    ]
    lines = [f"if {layout.at('status')} == {UNSURE}.0:", *indent(one, 1)]
    count = ["unsure = 0", "for i in range(U(n)):", f"    unsure += 1 if {layout.at('status')} == {UNSURE}.0 else 0",
             "if unsure == 0:", "    return"]
    return block_loop("settle_block", "s, o, n, h", layout, lines, count)


def _state(layout: Layout) -> list[str]:
    """Return the source lines that read the state and the parameters with which a step of an environment starts."""
    shape = layout.shape
    names = ("index", *layout.moved, *shape.extra, "status", "speed_limit", *shape.pull)
    return [*layout.load(*names, sliding=True), *side_of_turns(layout)]


def _kept(layout: Layout, taken: str) -> list[str]:
    """Return the source lines that store the state after a step if it is ``good``; ``taken`` adds to the step count.

    The newest value of a history that slides is always stored, because a run that has stopped does not continue.
    """
    slid = {name for names in layout.histories for name in names}
    return [*(f"{layout.sliding(name, 1)} = {name}1" for name, *_ in layout.histories),
            *(f"{layout.at(name)} = {name}1 if good else {name}" for name in layout.moved if name not in slid),
            f"{layout.at('index')} = index + {taken}"]


def _steps(layout: Layout, depth: int) -> list[str]:
    """Return the source lines of one step of a block."""
    parts = ("advance_block", *(("settle_block",) if layout.shape.slack else ()))
    room = f"U({AHEAD * BLOCK})"
    slid = [f"slide -= U({BLOCK})", "if slide == 0:", *_moved_back(layout, room, 1),
            f"    slide = {room}"] if layout.histories else []
    return indent([*(f"{part}({joined(layout.step_arguments, layout.shared)})" for part in parts), *slid], depth)


def _remember_block(layout: Layout) -> str:
    """Write the source of ``remember_block``, which advances the effects' state variables by one control step."""
    shape = layout.shape
    lines = [
        *layout.load("index", "status", "control", *shape.remembered, *shape.parameters),
        "first = 1.0 if index == 0.0 else 0.0",
        shape.remember("span"),
        *[f"{layout.at(name)} = {name}1 if status == 0.0 else {name}" for name in shape.remembered],
    ]
    return block_loop("remember_block", "s, o, n, span", layout, lines)


def _begin_block(layout: Layout) -> str:
    """Write the source of ``begin_block``, which recomputes a multistep method's history after a change of control."""
    shape = layout.shape
    history = tuple(f"{name}1" for name in shape.memory)
    stale = [*layout.load("index", "held", "control"), f"stale += 1 if {shape.stale} else 0"]
    lines = [
        *layout.load("index", "q", "turns", "v", "held", *shape.memory, *shape.extra),
        *([] if "control" in shape.extra else layout.load("control")),
        *side_of_turns(layout),
        f"{joined(history)} = begin({joined(('index*h', 'q', 'v', 'h'), shape.extra)})",
        f"fresh = {shape.stale}",
        *[f"{layout.at(name)} = {name}1 if fresh else {name}" for name in shape.memory],
        f"{layout.at('held')} = control",
    ]
    check = ["stale = 0", "for i in range(U(n)):", *indent(stale, 1), "if stale == 0:", "    return"]
    return block_loop("begin_block", "s, o, n, h", layout, lines, check)


def _begun(when: str, steps: str, layout: Layout, depth: int = 2) -> list[str]:
    """Return the source lines that begin a control step of ``steps`` steps, executed under the condition ``when``.

    They advance the effects' state variables, such as gusts, and compute a new history of a multistep method.
    """
    blocks = {"remember_block": (layout.shape.remembered, f"{steps}*h"), "begin_block": (layout.shape.memory, "h")}
    calls = [f"{name}({joined(('s', 'o', 'n', time), layout.shared)})" for name, (any_, time) in blocks.items() if any_]
    return indent([f"if {when}:", *indent(calls, 1)], depth) if calls else []


def _observe(layout: Layout, write: Templates) -> str:
    """Write the source of ``observe``: observations, rewards, ends of episodes and reported quantities of a block.

    It writes to the user's arrays or, where the loop could then not take several environments at once, all but rewards
    and quantities to ``o``; see :attr:`Layout.told_at_once`.
    """
    goal = layout.goal
    assert goal is not None
    told = ["truncated[i] = late", "terminated[i] = status != 0.0",
            *[f"observation[i, {column}] = {name}" for column, name in enumerate(goal.seen)]]
    if not layout.told_at_once:
        told = [f"{layout.out('late')} = 1.0 if late else 0.0", f"{layout.out('ended')} = status",
                *[f"{layout.out(name)} = {name}" for name in goal.seen]]
    turned = ["cosine = -cosine", "sine = -sine"] if goal.upright else []
    lines = [
        *_loaded(layout),
        *layout.load(*goal.before),
        *write.lines(report.observed),
        *goal.aimed(),
        *_reported(layout, write),
        f"late = index + (1.0 if status == {DIVERGED}.0 else 0.0) > bound",
        *(write.lines(_judged) if layout.shape.ledger else []),
        f"status = {LOST}.0 if {goal.call(goal.lost)} & (status == 0.0) else status",
        f"reward[i] = {goal.call(goal.reward)}",
        *[f"{layout.at(name)} = {BEFORE[name]}" for name in goal.before],
        *goal.ahead(),
        *turned,
        *told,
        f"{layout.at('status')} = {LATE}.0 if late & (status == 0.0) else status",
        *[f"row_{name}[i] = r_{name}" for name in layout.reports],
    ]
    arguments = joined(("s", "o", "n", "h", "bound", *_user_arrays(layout)), layout.rows)
    return block_loop("observe", arguments, layout, lines, separate=True)


def _user_arrays(layout: Layout) -> tuple[str, ...]:
    """Return the names of the user's arrays, other than reported quantities, that ``observe`` writes to."""
    return ("reward", "observation", "terminated", "truncated") if layout.told_at_once else ("reward",)


def _record(layout: Layout, write: Templates) -> str:
    """Write the source of ``record``: the recorded quantities of a block of runs; nan for runs that stopped earlier."""
    lines = [
        *_loaded(layout),
        *_reported(layout, write),
        *(write.lines(_judged) if layout.shape.ledger else []),
        f"{layout.at('status')} = status",
        "gone = index < reached",
        *[f"row_{name}[i] = NAN if gone else r_{name}" for name in layout.reports],
    ]
    return block_loop("record", joined(("s", "o", "n", "h", "reached"), layout.rows), layout, lines, separate=True)


def _loaded(layout: Layout) -> list[str]:
    """Return the source lines that read a block's values from which the reported quantities are computed."""
    shape = layout.shape
    state = ("index", "q", "turns", "v", "status", "control", "initial", *shape.sums, *shape.lost,
             *shape.remembered)
    return [*layout.load(*state, *layout.numbers), *side_of_turns(layout)]


def _reported(layout: Layout, write: Templates) -> list[str]:
    """Return the source lines that compute the reported quantities, and store the energy at step 0 for the ledger.

    Runs without a task report at least motion and energies.
    """
    shape = layout.shape
    lines: list[str] = []
    if shape.ledger or not layout.goal:
        lines = [*write.lines(report.stored), *(["r_time = index*h"] if shape.ledger else []),
                 *write.lines(report.place), *write.lines(report.energies)]
    if shape.ledger:
        lines += ["initial = r_energy if index == 0.0 else initial", f"{layout.at('initial')} = initial",
                  *write.lines(report.balance)]
    if shape.compensated and lines:
        lines += write.lines(report.remainders)
    return [*lines, *write.lines(report.diagnosed)]


@specialise.spliced
def _judged(status: float, r_energy_residual: float, scale: float, initial: float, r_work: float) -> float:
    """Return the status of a pendulum, which stops as diverged if its energy residual is absurdly large."""
    status = report.judged(status, r_energy_residual, scale, initial, r_work)
    return status


def _step_blocks(layout: Layout) -> str:
    """Write the source of ``step_blocks``: steps of a range of blocks, with results in arrays of all environments.

    The range is from ``first`` to ``last``, exclusive. The generated function begins a control step of ``hold`` steps,
    or continues one if ``hold`` is 0. With 0 substeps it only computes observations and reported quantities. Result
    arrays of length 0 are not filled. An episode is truncated once it has taken more than ``bound`` steps, where a step
    that diverged counts as taken. For adaptive steps see :func:`_turns`.

    The function returns the number of blocks in which an episode has ended and, for a task with a user's functions,
    WRONG times the number of rewards that are not finite. If the range is all blocks and an action is not finite, it
    returns REFUSED before it does anything.
    """
    shared = "".join(f", {name}" for name in layout.shared)
    place = {name: BLOCK * i for i, name in enumerate(layout.results)}
    adaptive, more, goal = layout.shape.adaptive, _more(layout), layout.goal
    assert goal is not None
    rows = joined([f"{name}[base:base + n]" for name in _user_arrays(layout)],
                  [f"info[{k}, base:base + n]" for k in range(len(layout.reports))])
    steps = [*_begun("hold > 0", "hold", layout), "        for _ in range(substeps):", *_steps(layout, 3)]
    if adaptive:
        fresh = f"hold > 0 and turn == 0 and {layout.active} == 0.0"
        steps = [*_turns("substeps", [*_begun(fresh, "hold", layout, 0), *_attempts(layout)]),
                 "        if turn < substeps:", "            continue"]
    return "\n".join(
        [
            "@entry",
            "def step_blocks(state, o, first, last, size, h, substeps, hold, bound, action, observation, reward,",
            f"                terminated, truncated, info{more}{shared}):",
            "    if first == 0 and last - first == len(state):",
            *indent(LOOKED, 2),
            "    r_found = 0",
            "    for b in range(first, last):",
            *(ENDED if adaptive else []),
            "        s = state[b]",
            f"        base = {BLOCK}*b",
            f"        n = min({BLOCK}, size - base)",
            "        asked = action[base:base + n]",
            "        for i in lanes(n):",
            f"            o[i + U({place['control']})] = "
            "-1.0 if asked[i] < -1.0 else (asked[i] if asked[i] < 1.0 else 1.0)",
            *steps,
            "        n = max(0, min(n, len(reward) - base))",
            f"        observe(s, o, n, h, bound, {rows}{shared})",
            "        over = terminated[base:base + n]",
            "        late = truncated[base:base + n]",
            *([
                "        seen = observation[base:base + n]",
                "        for i in lanes(n):",
                *[f"            seen[i, {k}] = o[i + U({place[name]})]" for k, name in enumerate(goal.seen)],
                "        for i in lanes(n):",
                f"            over[i] = o[i + U({place['ended']})] != 0.0",
                "        for i in lanes(n):",
                f"            late[i] = o[i + U({place['late']})] != 0.0",
            ] if not layout.told_at_once else []),
            *([
                "        given = reward[base:base + n]",
                "        for i in range(U(n)):",
                f"            r_found += 0 if abs(given[i]) <= {LARGEST} else {WRONG}",
            ] if goal.doubted else []),
            "        r_ended = False",  # last: to read over and late right after they are written would wait for memory
            "        for i in range(U(n)):",
            "            r_ended = r_ended | over[i] | late[i]",
            "        r_found += 1 if r_ended else 0",
            "    return r_found",
            "",
        ]
    )


def _run_blocks(layout: Layout) -> str:
    """Write the source of ``run_blocks``: ``rows`` times ``every`` steps of a range of blocks, after ``taken`` steps.

    After every ``every`` steps the reported quantities of all runs are written to one row of ``out``, an array ``(rows,
    quantities, runs)``, unless it is empty. All rows of a block are computed before the next block begins, so that the
    block stays in the processor's cache. In scenes with effect state, such as gusts, a control step has ``hold`` steps.
    For adaptive steps see :func:`_turns`.
    """
    remembers, adaptive = bool(layout.shape.remembered), layout.shape.adaptive
    hold = ", hold" if remembers else ""
    shared = "".join(f", {name}" for name in layout.shared)
    rows = [f"out[row, {k}, base:base + n]" for k in range(len(layout.reports))]
    write = [f"record({joined(('s', 'o', 'n', 'h', 'taken + (row + 1.0)*every'), rows)}{shared})"]
    loops = [
        *(["        count = taken"] if remembers else _begun("rows*every > 0", "", layout)),
        *([f"        slide = U({AHEAD * BLOCK})"] if layout.histories else []),
        "        for row in range(rows):",
        "            for _ in range(every):",
        *(_begun("count % hold == 0", "hold", layout, 4) if remembers else []),
        *(["                count += 1"] if remembers else []),
        *_steps(layout, 4),
        "            if len(out) == 0:",
        "                continue",
        *indent(write, 3),
        *_moved_back(layout, f"U({AHEAD * BLOCK}) - slide", 2),
    ]
    if adaptive:  # a turn is a step or, after every ``every`` steps, a record
        fresh = f"{layout.active} == 0.0 and (taken + turn - row) % hold == 0"
        loops = _turns("rows*(every + 1)", [
            "row = turn // (every + 1)",
            "if turn - row*(every + 1) < every:",
            *indent([*(_begun(fresh, "hold", layout, 0) if remembers else []), *_attempts(layout)], 1),
            "elif len(out) > 0:",
            *indent(write, 1),
        ])
    return "\n".join(
        [
            "@entry",
            f"def run_blocks(state, o, first, last, size, h, rows, every, control, out, taken{hold}{_more(layout)}"
            f"{shared}):",
            "    for b in range(first, last):",
            *(ENDED if adaptive else []),
            "        s = state[b]",
            f"        base = {BLOCK}*b",
            f"        n = min({BLOCK}, size - base)",
            f"        o[:{BLOCK}] = control",
            *loops,
            "    return 0",
            "",
        ]
    )


# --- turns: steps that several calls take -----------------------------------------------------------------------------

ENDED = ["        if progress[b, 0] < 0:", "            continue"]
"""Source lines that skip a block which has taken all its turns in an earlier call."""


def _more(layout: Layout) -> str:
    """Return the source of the further arguments of a program for adaptive steps; see :func:`_turns`."""
    return ", work, progress, tries" if layout.shape.adaptive else ""


def _attempts(layout: Layout) -> list[str]:
    """Return the source lines of an adaptive step of a block, which leave the loop if it is not at its end."""
    return [f"left = advance_block({joined(('s', 'o', 'w', 'n', 'left', 'h'), layout.shared)})",
            f"if {layout.active} > 0.0:", "    break"]


def _turns(total: str, turn: Iterable[str]) -> list[str]:
    """Return the source lines of ``total`` turns of a block, in as many calls as they need.

    ``turn`` are the lines of one turn. Every call makes at most ``tries`` attempts of adaptive steps per pendulum of a
    block, so that Ctrl-C can interrupt a run between calls. The row ``progress[b]`` of two whole numbers holds the
    number of turns that block ``b`` has taken, -1 after the last, and the number of attempts.
    """
    lines = [
        "w = work[b]",
        "turn = progress[b, 0]",
        "left = tries",
        f"while turn < {total}:",
        *indent([*turn, "turn += 1"], 1),
        f"progress[b, 0] = turn if turn < {total} else -1",
        "progress[b, 1] += tries - left",
    ]
    return indent(lines, 2)
