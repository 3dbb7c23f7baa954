"""The whole exercise worked out: what was measured, and the numbers and runs of both parts."""

from __future__ import annotations

from dataclasses import dataclass, replace

from integrators import from_step
from integrators.families.own_step import OwnStep, StepFunction
from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.exercise.given import Given
from pendulum_env.exercise.large_angles import LargeAngles, large_angles
from pendulum_env.exercise.motion import OWN
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
        own: the student's own step; None without one.
    """

    given: Given
    small: SmallAngles
    large: LargeAngles
    recorded: Recorded
    own: OwnStep | None = None


def work_out(
    given: Given, progress: Progress | bool | None = None, *, step: StepFunction | str | OwnStep | None = None
) -> Worked:
    """Work out the exercise.

    Args:
        given: what was measured.
        progress: function that is called with the fraction done and the present activity, or True for a progress bar;
            by default a notebook shows one.
        step: the student's own step, which runs beside the three Euler methods; as for
            :func:`integrators.from_step`, or what that returns.

    Raises RecordingError for a recording with too few swings, MethodError for a step that is none or that does not stay
    finite.
    """
    own = step if step is None or isinstance(step, OwnStep) else from_step(step)
    own = None if own is None else replace(own, name=OWN)
    with telling_of(progress, "exercise") as tell:
        omega = given.omega.value.value
        tell(0.0, "small angles")
        small = small_angles(omega, own)
        tell(0.3, "large angles")
        large = large_angles(omega, own)
        tell(0.6, "friction and the recording")
        friction = recorded(given)
        tell(1.0, "worked out")
    return Worked(given, small, large, friction, own)
