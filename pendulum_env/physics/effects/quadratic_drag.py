"""Drag proportional to the square of the velocity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import BOBS_DRAG, Effect, Kind, lossy
from pendulum_env.physics.elementary import exp, log, sqrt
from pendulum_env.physics.flow import CLIFT_GAUVIN_LIMIT, STOKES_LIMIT, reynolds_number, sphere_drag_coefficient
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si

STEADY = 500.0
"""Reynolds number from which C_d of a sphere is nearly constant (Clift, Grace & Weber 1978, chapter 5)."""
ALIKE = 1.25
"""Largest ratio, either way, of a run's C_d to that of the scene's usual run without a warning."""


def quadratic_drag(slip: float, speed: float, quadratic_drag_rate: float) -> float:
    return -quadratic_drag_rate * speed * slip


def quadratic_drag_by_velocity(velocity: float, quadratic_drag_rate: float) -> float:
    return -2.0 * quadratic_drag_rate * abs(velocity)


def quadratic_drag_by_speed(slip: float, speed: float, quadratic_drag_rate: float) -> float:
    return -quadratic_drag_rate * speed * slip


def quadratic_drag_flow(velocity: float, duration: float, quadratic_drag_rate: float) -> float:
    remaining = 1.0 + quadratic_drag_rate * abs(velocity) * duration
    return velocity / remaining if remaining > 0.0 else 1e999 - 1e999  # nan: the speed was infinite at an earlier time


def sinh_over(x: float) -> float:
    """Return sinh(x)/x."""
    z = x * x
    near = 1.0 + z / 6.0 * (1.0 + z / 20.0 * (1.0 + z / 42.0 * (1.0 + z / 72.0 * (1.0 + z / 110.0 * (
        1.0 + z / 156.0 * (1.0 + z / 210.0 * (1.0 + z / 272.0)))))))
    far = abs(x) >= 1.0
    y = x if far else 1.0
    return 0.5 * (exp(y) - exp(-y)) / y if far else near


def quadratic_drag_fade(
    slip: float, cross: float, duration: float, quadratic_drag_rate: float
) -> tuple[float, float]:
    reach = quadratic_drag_rate * duration
    x = cross * reach
    growth = sqrt(slip * slip + cross * cross) * reach * sinh_over(x) + 0.5 * (exp(x) + exp(-x))
    growth = growth if growth > 0.0 else 1e999 - 1e999  # nan: the speed was infinite at an earlier time
    return slip / growth, log(growth)


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Drag proportional to the square of the speed: torque -I c |v| v, with c measured or from C_d.

    Per inertia: ``-c |v| v`` with ``c = rho C_d A L**3 / (2 I)`` [1/rad]. By default C_d is that of a sphere at the
    Reynolds number of the scene's usual run at the bottom (law clift_gauvin of
    :data:`pendulum_env.physics.drag_laws.LAWS`). The amplitude falls by (4/3) c A² per half swing. Raises SceneError
    where C_d is needed but not known: Re below 0.01, where drag is linear for any bob, or above 2e5. The second
    derivative of the torque jumps at v = 0, so methods of order above 3 lose order there.
    """

    c: float | None = si(None, "1/rad", "damping per angle; by default from C_d", least=0.0, optional=True)
    drag_coefficient: float | None = si(None, "1", "C_d; by default that of a sphere", least=0.0, optional=True)

    name: ClassVar[str] = "quadratic_drag"
    kind: ClassVar[Kind] = "dissipative"
    detail: ClassVar[int] = 1
    damping: ClassVar[str] = "quadratic"
    fitted: ClassVar[str] = "c"
    equation: ClassVar[str] = "- {quadratic_drag_rate:.6g} |theta'| theta'"
    source: ClassVar[str] = "Newton 1687, Principia II; Nelson & Olsson 1986"
    number_name: ClassVar[str] = "c A"
    torque = staticmethod(quadratic_drag)
    by_velocity = staticmethod(quadratic_drag_by_velocity)
    by_speed = staticmethod(quadratic_drag_by_speed)
    flow = staticmethod(quadratic_drag_flow)
    fade = staticmethod(quadratic_drag_fade)

    @property
    def models(self) -> str:
        return BOBS_DRAG

    @property
    def needs(self) -> str:
        return "" if self.c is not None else "sphere" if self.drag_coefficient is None else "width"

    def check(self, scene: Surroundings) -> None:
        if self.c is not None and self.drag_coefficient is not None:
            raise SceneError("Quadratic drag takes c or drag_coefficient, not both.")
        if self.c is None and scene.medium.density == 0.0:
            raise SceneError(
                f"Quadratic drag cannot be derived in {scene.medium.name}, which has no density; give a number, as in "
                "damping={'quadratic': {'c': 0.01}}."
            )
        if self.c is None and self.drag_coefficient is None and (unknown := self._unknown(scene)):
            raise SceneError(
                f"Quadratic drag's C_d cannot be derived, because {unknown}; give c or drag_coefficient, as in "
                "damping={'quadratic': {'drag_coefficient': 0.46}}."
            )

    @staticmethod
    def _unknown(scene: Surroundings) -> str:
        """Return why the bob's drag coefficient C_d cannot be derived from the scene's usual run, or "" if it can."""
        reynolds = scene.reynolds
        if scene.medium.viscosity == 0.0:
            return f"{scene.medium.name} has no viscosity, so the flow has no Reynolds number"
        if reynolds < STOKES_LIMIT:
            return f"the bob hardly moves in the usual run (Re = {reynolds:.3g}, below {STOKES_LIMIT:g})"
        if reynolds > CLIFT_GAUVIN_LIMIT:
            return f"C_d is known up to Re = {CLIFT_GAUVIN_LIMIT:g} and the usual run reaches Re = {reynolds:.3g}"
        return ""

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        if self.c is not None:
            return {"quadratic_drag_rate": self.c}
        body = scene.body
        drag = self.drag_coefficient
        if drag is None:
            drag = sphere_drag_coefficient(scene.reynolds)
        rate = body.drag_moment(0.5 * scene.medium.density * drag) / scene.inertia
        return {"quadratic_drag_rate": rate}

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return self.coefficients(scene)["quadratic_drag_rate"] * amplitude

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return lossy(scene, amplitude, 4.0 / 3.0 * self.number(scene, amplitude))

    def outside(self, scene: Surroundings, speed: float) -> str:
        reynolds = reynolds_number(speed, scene.body, scene.medium)
        if self.c is not None:
            return ""
        if STEADY <= reynolds <= CLIFT_GAUVIN_LIMIT:
            return "" if self.drag_coefficient is not None else self._elsewhere(scene.reynolds, reynolds)
        side = "only" if reynolds < STEADY else "even"
        return (
            f"Re reaches {side} {reynolds:.3g}, but C_d is nearly constant only from Re = {STEADY:g} to "
            f"{CLIFT_GAUVIN_LIMIT:g}; a constant C_d is used all the same"
        )

    @staticmethod
    def _elsewhere(usual: float, reynolds: float) -> str:
        """Return a warning if the bob's C_d at a Reynolds number differs from that at ``usual``, the Reynolds number of
        the scene's usual run, which the effect uses; else "".
        """
        used, here = sphere_drag_coefficient(usual), sphere_drag_coefficient(reynolds)
        if used <= ALIKE * here and here <= ALIKE * used:
            return ""
        return (f"C_d = {used:.2f} is that of Re = {usual:.4g} in the scene's usual run, and at Re = {reynolds:.4g} "
                f"C_d is {here:.2f}; give drag_coefficient or use sphere_drag")

    @classmethod
    def trial(cls, scene: Surroundings) -> QuadraticDrag | None:
        effect = cls()
        return effect if scene.medium.density > 0.0 and not effect._unknown(scene) else None
