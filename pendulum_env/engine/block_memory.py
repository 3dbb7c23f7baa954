"""What blocks of environments hand on from step to step, begun and advanced: source."""

from __future__ import annotations

from pendulum_env.engine.layout import Layout, block_loop, side_of_turns
from pendulum_env.engine.shape import indent, joined


def remember_block(layout: Layout) -> str:
    """What effects remember, advanced by a control step, where it has not stopped."""
    shape = layout.shape
    lines = [
        *layout.load("index", "status", "control", *shape.remembered, *shape.parameters),
        "first = 1.0 if index == 0.0 else 0.0",
        shape.remember("span"),
        *[f"{layout.at(name)} = {name}1 if status == 0.0 else {name}" for name in shape.remembered],
    ]
    return block_loop("remember_block", "s, o, n, span", layout, lines)


def begin_block(layout: Layout) -> str:
    """What the first step takes of earlier ones; anew after every change of control."""
    shape = layout.shape
    made = tuple(f"{name}1" for name in shape.memory)
    stale = [*layout.load("index", "held", "control"), f"stale += 1 if {shape.stale} else 0"]
    lines = [
        *layout.load("index", "q", "turns", "v", "held", *shape.memory, *shape.extra),
        *([] if "control" in shape.extra else layout.load("control")),
        *side_of_turns(layout),
        f"{joined(made)} = begin({joined(('index*h', 'q', 'v', 'h'), shape.extra)})",
        f"fresh = {shape.stale}",
        *[f"{layout.at(name)} = {name}1 if fresh else {name}" for name in shape.memory],
        f"{layout.at('held')} = control",
    ]
    looked = ["stale = 0", "for i in range(U(n)):", *indent(stale, 1), "if stale == 0:", "    return"]
    head, *body = block_loop("begin_block", "s, o, n, h", layout, lines).split("\n")[1:]
    return "\n".join(["@inline", head, *indent(looked, 1), *body])


def begun(when: str, steps: str, layout: Layout, depth: int = 2) -> list[str]:
    """Lines that advance what effects remember by so many steps, and begin a method's memory."""
    blocks = {"remember_block": (layout.shape.remembered, f"{steps}*h"), "begin_block": (layout.shape.memory, "h")}
    calls = [f"{name}({joined(('s', 'o', 'n', time), layout.shared)})" for name, (any_, time) in blocks.items() if any_]
    return indent([f"if {when}:", *indent(calls, 1)], depth) if calls else []
