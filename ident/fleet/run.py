"""Where the work is done: in this process, on workers of this machine, or on a Dask cluster.

Dask gives the queue, and gives a job that died with its worker to another one. What comes back is handed on
as it comes; whoever needs an order sorts.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ident.fleet.jobs import FleetError, Job
from ident.fleet.work import Done

CONNECT_S = 10


def run(
    jobs: Sequence[Job], work: Callable[..., Done], arguments: Sequence[Any], client: Any = None
) -> Iterator[tuple[Job, Done]]:
    """(job, what came of it) as they end; workers begin at once, `client` None works in this process."""
    if client is None:
        return ((job, work(job, *arguments)) for job in jobs)
    return _gathered({client.submit(work, job, *arguments, pure=False): job for job in jobs})


def _gathered(futures: dict[Any, Job]) -> Iterator[tuple[Job, Done]]:
    from distributed import as_completed

    for future in as_completed(list(futures)):
        job = futures.pop(future)
        error = future.exception()
        yield job, future.result() if error is None else Done(reason=_lost(job, error))
        future.release()


def _lost(job: Job, error: BaseException) -> str:
    if type(error).__name__ == "KilledWorker":
        return f"{job.url}: its worker died each time it was tried; give workers more memory"
    return f"{job.url}: {type(error).__name__}: {error}"


@contextlib.contextmanager
def connected(scheduler: str | None) -> Iterator[Any]:
    """A client of the scheduler at this address, of workers of its own for "local", None for None.

    Raises FleetError.
    """
    if not scheduler:
        yield None
        return
    try:
        import distributed
    except ImportError:
        raise FleetError("--scheduler needs Dask; pip install 'dynident[fleet]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        try:
            address: Any = scheduler
            if scheduler == "local":
                address = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=os.cpu_count() or 1,
                        threads_per_worker=1,
                        dashboard_address=None,
                        host="127.0.0.1",
                    )
                )
            client = stack.enter_context(distributed.Client(address, timeout=CONNECT_S))
        except (OSError, ValueError, TypeError) as error:
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise FleetError(
                f"no Dask scheduler answers at {scheduler} ({reason}); start one with dask scheduler, or "
                "give --scheduler local"
            ) from None
        yield client
