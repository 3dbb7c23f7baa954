"""What the tests of the audit share: small scenes, and an audit's rows by name."""

import math

from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity
from pendulum_env.physics.medium import air
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.study.audit.study import audit
from pendulum_env.study.audit.verdicts import AuditRow

W = math.sqrt(9.81)
AIRY = Scene("airy", Body(), air(20.0), (Gravity(),))
WEIGHTS = ["gravity", "small_angle_gravity"]
CORRECTIONS = ("support_compliance", "wire_flexure")


def of(*effects) -> Scene:
    """The vacuum scene (1 m, 1 kg, g 9.81) with other effects."""
    return SCENES["vacuum"].with_effects(effects)


def asked(scene, amplitude, tolerance, effects=None) -> dict[str, AuditRow]:
    rows = audit(scene, amplitude=amplitude, tolerance=tolerance, effects=effects, backend="python").rows
    return {row.effect: row for row in rows}
