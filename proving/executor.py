"""Where a campaign's blocks of seeds are worked through: this process, processes of this machine, or a Dask cluster.

A worker that dies loses nothing: its block is done again, by another.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent import futures
from typing import TYPE_CHECKING, Any, TypeVar

from rig.errors import RigError, UsageError

if TYPE_CHECKING:
    from distributed import Client

Seeds = tuple[int, ...]
R = TypeVar("R")

DEATHS = 50
"""So many workers may die one after another before any block is finished; then the work itself kills them."""


class WorkersDie(RigError):
    """Workers die faster than they finish anything."""


class Executor(ABC):
    """Where blocks of seeds are worked through."""

    def run(self, work: Callable[[Seeds], R], blocks: Iterable[Seeds]) -> Generator[tuple[Seeds, R]]:
        """Work through blocks; each is given back once, with its result, as soon as it is done.

        Args:
            work: of one block; pickled, so a function of a module, or a `partial` of one.
            blocks: of seeds.

        Raises:
            WorkersDie: `DEATHS` workers died and no block was finished meanwhile.
            Exception: what `work` raised.

        """
        waiting = deque(blocks)
        under_way: dict[futures.Future[R], Seeds] = {}
        deaths = 0
        pool = self._open()
        try:
            while waiting or under_way:
                broken = False
                while waiting and not broken and len(under_way) < 2 * max(self._width(), 1):
                    try:
                        under_way[pool.submit(work, waiting[0])] = waiting[0]
                        waiting.popleft()
                    except self._lost:
                        broken = True
                finished, _ = futures.wait(under_way, return_when=futures.FIRST_COMPLETED)
                done: list[tuple[Seeds, R]] = []
                for future in finished:
                    block = under_way.pop(future)
                    try:
                        done.append((block, future.result()))
                    except self._lost:
                        waiting.appendleft(block)
                        broken = True
                    except futures.CancelledError:
                        raise WorkersDie("the scheduler has gone, or has been told to forget this campaign") from None
                deaths = 0 if done else deaths + broken
                if deaths >= DEATHS:
                    raise WorkersDie(f"{deaths} workers died one after another, the last with a block of {waiting[0]}")
                if broken:
                    pool = self._again(pool, under_way, waiting)
                yield from done
        finally:
            for future in under_way:
                future.cancel()  # Dask's pool does not do that itself
            pool.shutdown()

    _lost: tuple[type[BaseException], ...] = (futures.BrokenExecutor,)
    """What a block ends in whose worker died."""

    @abstractmethod
    def close(self) -> None:
        """Leave what it works with."""

    @abstractmethod
    def _open(self) -> futures.Executor:
        """Workers, ready."""

    @abstractmethod
    def _width(self) -> int:
        """How many blocks are worked on at once."""

    def _again(
        self, pool: futures.Executor, under_way: dict[futures.Future[R], Seeds], waiting: deque[Seeds]
    ) -> futures.Executor:
        """Workers after one has died: the standard library's pool is then of no more use, its other blocks are lost."""
        pool.shutdown()
        waiting.extendleft(under_way.values())
        under_way.clear()
        return self._open()


class Processes(Executor):
    """Processes of this machine; they end with the campaign, however it ends.

    Args:
        jobs: how many; one is this process itself.

    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs

    def run(self, work: Callable[[Seeds], R], blocks: Iterable[Seeds]) -> Generator[tuple[Seeds, R]]:
        """As `Executor.run`."""
        return ((block, work(block)) for block in blocks) if self._jobs == 1 else super().run(work, blocks)

    def close(self) -> None:
        """As `Executor.close`; processes have ended with what they did."""

    def _open(self) -> futures.Executor:
        # Workers come from a server without threads: a process with threads (a progress bar's) must not be forked.
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["proving.night.campaign"])
        return futures.ProcessPoolExecutor(self._jobs, context, _end_with_parent)

    def _width(self) -> int:
        return self._jobs


class Dask(Executor):
    """Workers of a Dask cluster, which have this project in the same state (`proving.seeds` refuses others).

    Args:
        address: of its scheduler, `tcp://host:8786`.

    Raises:
        UsageError: Dask is not installed, or no scheduler answers.

    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, KilledWorker  # noqa: PLC0415 - an extra
        except ImportError:
            raise UsageError("--scheduler needs Dask: .venv/bin/pip install -c constraints.txt -e '.[dask]'") from None
        self._lost = (KilledWorker,)
        try:
            self._client: Client = Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise UsageError(f"--scheduler {address}: {error}") from error

    def run(self, work: Callable[[Seeds], R], blocks: Iterable[Seeds]) -> Generator[tuple[Seeds, R]]:
        """As `Executor.run`; a worker does one block at a time, however many threads it has."""
        return super().run(_Alone(work), blocks)

    def _open(self) -> futures.Executor:
        pool: futures.Executor = self._client.get_executor(pure=False)
        return pool

    def _width(self) -> int:
        return len(self._client.nthreads())

    def _again(
        self, pool: futures.Executor, under_way: dict[futures.Future[R], Seeds], waiting: deque[Seeds]
    ) -> futures.Executor:
        return pool  # the cluster goes on without the worker that died

    def close(self) -> None:
        """As `Executor.close`: the cluster goes on without this campaign."""
        self._client.close()


def executor(jobs: int, scheduler: str | None) -> Executor:
    """Processes of this machine, or the cluster of a scheduler where one is named. Raises `UsageError`."""
    return Processes(jobs) if scheduler is None else Dask(scheduler)


_CONNECT_S = 10.0
_one_at_a_time = threading.Lock()


class _Alone:
    """Work that never runs twice at once in a process: a night changes things that belong to all its threads."""

    def __init__(self, work: Callable[[Seeds], Any]) -> None:
        self._work = work

    def __call__(self, seeds: Seeds) -> Any:
        with _one_at_a_time:
            return self._work(seeds)


def _end_with_parent() -> None:
    """In a worker: end when the campaign does, also when that is killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
