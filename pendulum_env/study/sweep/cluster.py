"""Executor that runs the combinations of parameters of a sweep on a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from pendulum_env.truth.reference import StudyError

PATIENCE = 10
"""Longest wait for the answer of a scheduler [s]."""


@contextmanager
def executor_at(address: str | None) -> Iterator[Executor | None]:
    """Yield the executor of the Dask scheduler at an address such as ``tcp://HOST:PORT``; None without an address.

    Raises StudyError if Dask is not installed, no scheduler answers, or it has no workers. The workers need
    this package, too, with the same sources.
    """
    if address is None:
        yield None
        return
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError:
        raise StudyError('A scheduler needs Dask, which is missing: pip install "lab-pendulum[dask]".') from None
    try:
        get_address_host_port(address)
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = str(error) or type(error).__name__
        raise StudyError(f"No Dask scheduler answers at {address!r}, such as tcp://127.0.0.1:8786: {reason}") from None
    with client:
        if not client.scheduler_info()["workers"]:
            raise StudyError(f"The Dask scheduler at {address!r} has no workers; start some by: dask worker {address}")
        yield client.get_executor(pure=False)
