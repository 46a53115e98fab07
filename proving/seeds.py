"""Campaigns of seeds: each is worked through once, somewhere, and all results together have one digest."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from proving.executor import Executor, Seeds, executor
from proving.ledger import Ledger, Result
from rig.errors import UsageError

PACKAGES = ("rig", "drivers", "sims", "procedures", "fitter", "contracts", "proving", "examples")
"""What results depend on, beside the libraries."""


@dataclass(frozen=True)
class Campaign:
    """Something that is done with many seeds.

    Attributes:
        one: what is done with one; a function of a module, or a `partial` of one.
        name: of the campaign, with everything that its results depend on but the seed.
        block: seeds that are worked through together: lost together with their worker, and written together.

    """

    one: Callable[[int], Result]
    name: str
    block: int = 8


class Digest:
    """SHA-256 of results in order of their seeds, whoever made them, in whatever order."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()

    def add(self, seed: int, result: Result) -> None:
        """Add the next seed's result."""
        self._sha.update(json.dumps([seed, result], sort_keys=True).encode() + b"\n")

    def __str__(self) -> str:
        """In hexadecimal."""
        return self._sha.hexdigest()


def results(
    campaign: Campaign, seeds: range, workers: Executor, ledger: Ledger | None = None
) -> Generator[tuple[int, Result]]:
    """Results of seeds, in their order; those that are in the ledger are not made again.

    Raises:
        UsageError: the ledger, or a worker, has to do with another state of the program.
        Exception: what the campaign, or `Executor.run`, raised.

    """
    ready: dict[int, Result] = {}
    if ledger is not None:
        ledger.begin(campaign.name, source())
        ready = ledger.done(campaign.name, seeds)
    missing = [seed for seed in seeds if seed not in ready]
    work = partial(_block, campaign.one, source())
    blocks = [tuple(missing[at : at + campaign.block]) for at in range(0, len(missing), campaign.block)]
    with closing(workers.run(work, blocks)) as running:
        for seed in seeds:
            while seed not in ready:
                _, made = next(running)
                if ledger is not None:
                    ledger.add(campaign.name, made)
                ready |= made
            yield seed, ready.pop(seed)


@dataclass(frozen=True)
class Place:
    """Where campaigns work, and where they keep what they have done."""

    executor: Executor
    ledger: Ledger | None = None

    @classmethod
    @contextmanager
    def open(cls, jobs: int, scheduler: str | None, ledger: Path | None) -> Iterator[Place]:
        """As somebody asks for it.

        Args:
            jobs: processes of this machine.
            scheduler: of a Dask cluster instead, its address.
            ledger: a file to keep results in.

        Raises:
            UsageError: Dask is not there, or the file is not for this.

        """
        with ExitStack() as stack:
            kept = None if ledger is None else stack.enter_context(Ledger(ledger))
            yield cls(stack.enter_context(closing(executor(jobs, scheduler))), kept)

    def results(self, campaign: Campaign, seeds: range) -> Generator[tuple[int, Result]]:
        """As `results`."""
        return results(campaign, seeds, self.executor, self.ledger)


def _block(one: Callable[[int], Result], wanted: str, seeds: Seeds) -> dict[int, Result]:
    """In a worker. What JSON does to a result is done to all, whether they come from a ledger or not."""
    if source() != wanted:
        raise UsageError("a worker has another state of the program than the campaign: give all the same source")
    return {seed: json.loads(json.dumps(one(seed))) for seed in seeds}


@cache
def source() -> str:
    """SHA-256 of the project's own source, as this process found it."""
    root = Path(__file__).parent.parent
    sha = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*")):
            if path.is_file() and path.suffix != ".pyc":
                sha.update(f"{path.relative_to(root)}\0".encode() + path.read_bytes())
    return sha.hexdigest()
