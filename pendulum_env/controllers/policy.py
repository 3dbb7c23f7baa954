"""Policies that a program has learnt: small networks as arrays, run by NumPy, each with a card of how it was made."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.checks import file_path
from pendulum_env.common.results import one_line
from pendulum_env.common.saved import Savable
from pendulum_env.common.saved import load as load_result
from pendulum_env.controllers.swinging import batch_of
from pendulum_env.physics.units import SceneError, one_of, shown

Single = NDArray[np.float32]

POLICIES = ("swing_up", "balance", "track")
"""Names of the policies in the package, each that of its task."""
FOLDER = Path(__file__).with_name("policies")
"""Folder of their files."""


@dataclass(frozen=True, eq=False, repr=False)
class Policy(Savable):
    """A policy that is a network: ``x = scale observation``, then ``x = tanh(x weights + bias)`` layer by layer.

    Called with an observation it returns an action; the last layer has one number, so that actions are within (-1, 1).
    It computes in float32, as trainers do. Its noise while it learnt is left out: the action is the mean.

    Attributes:
        layers: for each layer its weights, an array (inputs, outputs), and its bias, an array (outputs,).
        scale: factors of the observation's entries, one for each input of the first layer.
        card: how the policy was made and what it earns: plain data, such as the "task", the "id" of its environment,
            "training" and "evaluation"; ``print(policy)`` shows them.

    Raises SceneError for arrays that do not fit each other, or numbers that are not finite.
    """

    layers: Sequence[tuple[Single, Single]]
    scale: Single
    card: Mapping[str, Any]

    def __post_init__(self) -> None:
        """Take the arrays as float32, after a check that they are those of a network."""
        try:
            with np.errstate(over="ignore"):  # numbers beyond float32 are refused below
                scale = np.array(self.scale, np.float32)
                layers = tuple((np.array(weights, np.float32), np.array(bias, np.float32))
                               for weights, bias in self.layers)
        except (TypeError, ValueError, OverflowError):
            raise SceneError("layers must be pairs of arrays, weights and bias, and scale an array.") from None
        size = scale.shape
        for number, (weights, bias) in enumerate(layers):
            if len(size) != 1 or weights.shape != (*size, *bias.shape):
                raise SceneError(f"Layer {number} has {size[-1] if size else 0} inputs, so that its weights and bias "
                                 f"have the shapes (inputs, outputs) and (outputs,), not {weights.shape} and "
                                 f"{bias.shape}.")
            size = bias.shape
        if not layers or size != (1,):
            raise SceneError("A policy has at least one layer, and the last has one output, the action.")
        if not all(np.isfinite(array).all() for array in (scale, *(one for pair in layers for one in pair))):
            raise SceneError("The numbers of a policy must be finite.")
        if not isinstance(self.card, Mapping):
            raise SceneError(f"card must be a dict, not {shown(self.card)}.")
        for name, value in {"scale": scale, "layers": layers}.items():
            object.__setattr__(self, name, value)

    def __call__(self, observation: Any) -> Single:
        """Return the action for an observation, float32 of shape (1,) for shape (k,), and (n, 1) for (n, k).

        k is the number of entries in the observation: 3, and 7 for a task with a reference. Raises ValueError for
        another shape or values that are not finite.
        """
        x = batch_of(observation, len(self.scale)).astype(np.float32)
        with np.errstate(over="ignore", under="ignore"):  # tanh is 1 where a product overflows
            actions: Single = self.act(x)
        return actions.reshape((*np.shape(observation)[:-1], 1))

    def act(self, x: Any) -> Any:
        """Return actions (..., 1) for an array of observations (..., k) of NumPy or of JAX, float32, without a check.

        JAX traces it, so that environments of ``pendulum_env.jax`` and the policy are one compiled program.
        """
        xp = x.__array_namespace__() if hasattr(x, "__array_namespace__") else np  # NumPy has it from 2.0 on
        x = x * self.scale
        for weights, bias in self.layers:
            x = xp.tanh(x @ weights + bias)
        return x

    def __repr__(self) -> str:
        return one_line(self, f"{self.card.get('task', 'of an unknown task')}, {self._sizes()}")

    def _sizes(self) -> str:
        """Return the numbers of the layers as text, such as "3 -> 64 -> 64 -> 1"."""
        return " -> ".join(str(count) for count in (len(self.scale), *(len(bias) for _, bias in self.layers)))

    def __str__(self) -> str:
        """Return the card as text: task, training, and what the policy earned in episodes that it had not seen."""
        card = self.card
        count = sum(weights.size + bias.size for weights, bias in self.layers)
        lines = [("policy", f"{card.get('task', '?')}, a network {self._sizes()} with tanh, {count} numbers"),
                 ("id", card.get("id", "?"))]
        lines += [(name, ", ".join(f"{key} {_words(value)}" for key, value in card[name].items()))
                  for name in ("training", "evaluation") if isinstance(card.get(name), Mapping)]
        return "\n".join(textwrap.fill(f"{name:12}{text}", 100, subsequent_indent=" " * 12) for name, text in lines)


def _words(value: Any) -> str:
    """Return a value of a card as text: numbers with 5 digits, a dict's in brackets."""
    if isinstance(value, Mapping):
        return f"({', '.join(f'{key} {_words(one)}' for key, one in value.items())})"
    if isinstance(value, list | tuple):
        return " to ".join(map(_words, value))
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def load(policy: str | Path) -> Policy:
    """Return a policy of the package by its name, such as "swing_up", or one in a file that its ``save`` wrote.

    ``print`` shows its card. Raises SceneError for an unknown name, with the nearest, and for a file that is damaged or
    has no policy; give a file's path with its ending, .npz or .zip.
    """
    if isinstance(policy, str) and Path(policy).suffix.lower() not in (".npz", ".zip"):
        path = FOLDER / f"{one_of(policy, 'policy', POLICIES)}.npz"
    else:
        path = file_path(policy, "policy")
    found = load_result(path)
    if not isinstance(found, Policy):
        raise SceneError(f"The file {path} has a {type(found).__name__}, not a policy; a trainer writes one with "
                         "pendulum_env.controllers.Policy(...).save(path).")
    return found
