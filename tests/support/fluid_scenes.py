"""Scenes in a fluid, with numbers worked out by hand."""

from __future__ import annotations

import math

from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    Effect,
    Gravity,
)
from pendulum_env.physics.medium import Medium, air
from pendulum_env.physics.scene import Scene

LENGTH, MASS, RADIUS = 0.353, 0.040, 0.0107

BODY = Body(length=LENGTH, mass=MASS, radius=RADIUS, suspension="wire")

AIR = air(20.0)

FREQUENCY = math.sqrt(9.81 / LENGTH)

LARGE = math.radians(30.0)


def scene_with(*effects: Effect, weight: Effect | None = None, body: Body = BODY, medium: Medium = AIR) -> Scene:
    return Scene(body=body, medium=medium, effects=(weight or Gravity(), *effects))
