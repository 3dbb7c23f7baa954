"""Analysis of methods: order, leading error, stability, and effects on areas in phase space.

The functions use the properties of :class:`integrators.Method`, in which a method states numbers and polynomials
(tableau, stability polynomials, characteristic polynomials). If a method does not state a property, it is computed from
steps of the method. No family of methods imports from this package.

Orders and areas are measured in 40-digit arithmetic (:mod:`integrators.analysis.measured`), which needs mpmath. Exact
results on the harmonic oscillator are in :mod:`integrators.analysis.linear`,
:mod:`integrators.analysis.multistep_linear`, :mod:`integrators.analysis.local_error` and
:mod:`integrators.analysis.stability`. :mod:`integrators.analysis.conditions` evaluates order conditions for a method of
any kind; the conditions themselves are in :mod:`integrators.analysis.trees`,
:mod:`integrators.analysis.nystrom_trees`, :mod:`integrators.analysis.conditions` and
:mod:`integrators.analysis.multistep_linear`.
"""

from integrators.analysis.conditions import order_residuals, splitting_order
from integrators.analysis.linear import (
    amplification,
    damping_limit,
    single_step,
    spectral_radius,
    stability_limit,
)
from integrators.analysis.local_error import LeadingError, Term, leading_error
from integrators.analysis.measured import (
    area_order,
    driven_pendulum,
    jacobian_determinant,
    observed_dense_order,
    observed_order,
    reference,
)
from integrators.analysis.multistep_linear import error_constant, order_defects, stability_angle
from integrators.analysis.nystrom_trees import NystromCondition, nystrom_conditions
from integrators.analysis.stability import (
    oscillation_errors,
    overdamping_limit,
    spectral_radii,
    stability_boundary,
    stability_function,
)
from integrators.analysis.trees import Condition, dense_conditions, order_conditions, principal_error

__all__ = [
    "Condition",
    "LeadingError",
    "NystromCondition",
    "Term",
    "amplification",
    "area_order",
    "damping_limit",
    "dense_conditions",
    "driven_pendulum",
    "error_constant",
    "jacobian_determinant",
    "leading_error",
    "nystrom_conditions",
    "observed_dense_order",
    "observed_order",
    "order_conditions",
    "order_defects",
    "order_residuals",
    "oscillation_errors",
    "overdamping_limit",
    "principal_error",
    "reference",
    "single_step",
    "spectral_radii",
    "spectral_radius",
    "splitting_order",
    "stability_angle",
    "stability_boundary",
    "stability_function",
    "stability_limit",
]
