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
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
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

    @abstractmethod
    def run(self, work: Callable[[Seeds], R], blocks: Iterable[Seeds]) -> Generator[tuple[Seeds, R]]:
        """Work through blocks; each is given back once, with its result, as soon as it is done.

        Args:
            work: of one block; pickled, so a function of a module, or a `partial` of one.
            blocks: of seeds.

        Raises:
            WorkersDie: `DEATHS` workers died and no block was finished meanwhile.
            Exception: what `work` raised.

        """

    @abstractmethod
    def close(self) -> None:
        """Leave what it works with."""


class Processes(Executor):
    """Processes of this machine; they end with the campaign, however it ends.

    Each has a pipe of its own and shares no lock with another, so that one killed at any moment stops nobody: a pool of
    the standard library may wait for ever for a lock that a killed worker held.

    Args:
        jobs: how many; one is this process itself.

    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        # Workers come from a server without threads: a process with threads (a progress bar's) must not be forked.
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["proving.night.campaign"])

    def run(self, work: Callable[[Seeds], R], blocks: Iterable[Seeds]) -> Generator[tuple[Seeds, R]]:
        """As `Executor.run`."""
        return ((block, work(block)) for block in blocks) if self._jobs == 1 else self._in_workers(work, deque(blocks))

    def _in_workers(self, work: Callable[[Seeds], R], waiting: deque[Seeds]) -> Generator[tuple[Seeds, R]]:
        workers: dict[Connection, _Worker] = {}
        deaths = 0
        try:
            while waiting or workers:
                while waiting and len(workers) < self._jobs:
                    worker = self._started(work)
                    workers[worker.pipe] = worker
                    worker.give(waiting.popleft())
                for pipe in wait(list(workers)):
                    assert isinstance(pipe, Connection)
                    worker = workers[pipe]
                    try:
                        finished, result = pipe.recv()
                    except (EOFError, OSError):  # it died, perhaps in the middle of an answer
                        del workers[pipe]
                        worker.end()
                        waiting.appendleft(worker.block)
                        deaths += 1
                        if deaths >= DEATHS:
                            last = f"the last with a block of {worker.block}"
                            raise WorkersDie(f"{deaths} workers died one after another, {last}") from None
                        continue
                    if not finished:
                        raise result
                    deaths, block = 0, worker.block
                    if waiting:
                        worker.give(waiting.popleft())
                    else:
                        del workers[pipe]
                        worker.end()
                    yield block, result
        finally:
            for worker in workers.values():
                worker.end()

    def _started(self, work: Callable[[Seeds], Any]) -> _Worker:
        pipe, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs, work), daemon=True)
        process.start()
        theirs.close()  # so that its death closes the pipe
        return _Worker(process, pipe)

    def close(self) -> None:
        """As `Executor.close`; processes have ended with what they did."""


@dataclass
class _Worker:
    """A process that works on one block at a time.

    Attributes:
        process: itself.
        pipe: to it.
        block: what it works on.

    """

    process: BaseProcess
    pipe: Connection
    block: Seeds = ()

    def give(self, block: Seeds) -> None:
        """Give it a block; that it is dead already is seen where its answer is waited for."""
        self.block = block
        with suppress(OSError):
            self.pipe.send(block)

    def end(self) -> None:
        """End it, whatever it does."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


def _serve(pipe: Connection, work: Callable[[Seeds], Any]) -> None:
    """In a worker: work on one block after the other."""
    _end_with_parent()
    with suppress(EOFError, BrokenPipeError):
        while True:
            block = pipe.recv()
            try:
                answer = True, work(block)
            except Exception as error:
                answer = False, error
            pipe.send(answer)


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
        self._killed = KilledWorker
        try:
            self._client: Client = Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise UsageError(f"--scheduler {address}: {error}") from error

    def run(self, work: Callable[[Seeds], R], blocks: Iterable[Seeds]) -> Generator[tuple[Seeds, R]]:
        """As `Executor.run`; a worker does one block at a time, however many threads it has."""
        waiting, alone = deque(blocks), _Alone(work)
        under_way: dict[futures.Future[R], Seeds] = {}
        deaths = 0
        pool: futures.Executor = self._client.get_executor(pure=False)
        try:
            while waiting or under_way:
                while waiting and len(under_way) < 2 * max(len(self._client.nthreads()), 1):
                    under_way[pool.submit(alone, waiting[0])] = waiting[0]
                    waiting.popleft()
                finished, _ = futures.wait(under_way, return_when=futures.FIRST_COMPLETED)
                for future in finished:
                    block = under_way.pop(future)
                    try:
                        result = future.result()
                    except self._killed:  # the cluster goes on without the worker that died
                        waiting.appendleft(block)
                        deaths += 1
                        if deaths >= DEATHS:
                            raise WorkersDie(f"{deaths} workers died one after another, with {block}") from None
                        continue
                    except futures.CancelledError:
                        raise WorkersDie("the scheduler has gone, or has been told to forget this campaign") from None
                    deaths = 0
                    yield block, result
        finally:
            for future in under_way:
                future.cancel()  # Dask's pool does not do that itself
            pool.shutdown()

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
