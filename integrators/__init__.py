"""Numerical methods for ``q'' = a(t, q, v)``: tables of coefficients, and the function ``solve`` that runs any method.

``solve_first_order`` runs those that can on ``y' = f(t, y)``.

>>> import integrators
>>> integrators.get("rk4").order
4
>>> sol = integrators.solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 1.0], method="rk4", h=0.01)
>>> round(float(sol.q[-1]), 6)
0.540302
"""

from integrators.families.energy_preserving import DiscreteGradient
from integrators.families.exact_flow import Exact
from integrators.families.force_gradient import ForceGradient
from integrators.families.multistep import Multistep
from integrators.families.nystrom import EmbeddedNystrom, Nystrom
from integrators.families.runge_kutta import Embedded, Extension, RungeKutta
from integrators.families.splitting import Splitting
from integrators.families.taylor import Taylor
from integrators.method import Method, MethodError, System
from integrators.registry import ALIASES, METHODS, PAIRS, fitting, get
from integrators.solving.adaptive import StepSizeError
from integrators.solving.events import Event
from integrators.solving.first_order import FirstOrderSolution, solve_first_order
from integrators.solving.own import from_step
from integrators.solving.solve import Solution, solve
from integrators.steps.unroll import unroll

__all__ = [
    "ALIASES",
    "METHODS",
    "PAIRS",
    "DiscreteGradient",
    "Embedded",
    "EmbeddedNystrom",
    "Event",
    "Exact",
    "Extension",
    "FirstOrderSolution",
    "ForceGradient",
    "Method",
    "MethodError",
    "Multistep",
    "Nystrom",
    "RungeKutta",
    "Solution",
    "Splitting",
    "StepSizeError",
    "System",
    "Taylor",
    "fitting",
    "from_step",
    "get",
    "solve",
    "solve_first_order",
    "unroll",
]
