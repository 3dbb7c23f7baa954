"""The whole exercise worked out: what was measured, and the numbers and runs of both parts."""

from __future__ import annotations

from dataclasses import dataclass

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.exercise.given import Given
from pendulum_env.exercise.large_angles import LargeAngles, large_angles
from pendulum_env.exercise.recorded import Recorded, recorded
from pendulum_env.exercise.small_angles import SmallAngles, small_angles


@dataclass(frozen=True, eq=False)
class Worked:
    """The exercise worked out.

    Attributes:
        given: what was measured, with the angular frequency from it.
        small: small angles, for Part 1 and the three Euler methods of Part 2.
        large: large angles without friction.
        recorded: friction, and the comparison with the recording.
    """

    given: Given
    small: SmallAngles
    large: LargeAngles
    recorded: Recorded


def work_out(given: Given, progress: Progress | bool | None = None) -> Worked:
    """Work out the exercise.

    ``progress`` is a function that is called with the fraction done and the present activity, or True for a progress
    bar; by default a notebook shows one. Raises RecordingError for a recording with too few swings.
    """
    with telling_of(progress, "exercise") as tell:
        omega = given.omega.value.value
        tell(0.0, "small angles")
        small = small_angles(omega)
        tell(0.3, "large angles")
        large = large_angles(omega)
        tell(0.6, "friction and the recording")
        friction = recorded(given)
        tell(1.0, "worked out")
    return Worked(given, small, large, friction)
