"""Adapters of the vector environment to other programs: Stable-Baselines3, TorchRL, Minari.

Each module imports its program, which is not among the package's dependencies: ``pendulum_env.adapters.sb3``,
``pendulum_env.adapters.torchrl``, ``pendulum_env.adapters.minari``. CleanRL's loops need no adapter.
"""

from __future__ import annotations


def missing(program: str, extra: str, error: ImportError) -> ImportError:
    """Return the error that says how to install a program which an adapter needs.

    ``error`` is returned as it is if something else could not be imported, such as a part of the installed program.
    """
    if not isinstance(error, ModuleNotFoundError):
        return error
    return ImportError(f"pendulum_env.adapters.{extra} needs {program}, but {error.name} is missing: "
                       f"pip install 'lab-pendulum[{extra}]'.", name=error.name)
