"""Give every door of the program mutated inputs; none may end in a traceback, hang for 5 s or take a gigabyte.

.venv/bin/python -m proving.doors.fuzz --total 1000000 [--door run] [--seed 1]
.venv/bin/python -m proving.doors.fuzz --door run --seed 4711 --inputs 1

The inputs of a door are made from consecutive seeds, in a process of its own: one that takes a gigabyte more than it
began with, that hangs where no signal reaches it, or that dies is counted, and another goes on with the next seed.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import logging
import mmap
import os
import resource
import signal
import struct
import sys
import tempfile
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from proving.doors.attack import DOORS, HANG_S, Found, Material, attack

SHARES = {
    "run": 0.08,
    "http": 0.08,
    "notify": 0.02,
    "contracts": 0.03,
    "beside": 0.01,
    "paths": 0.005,
    "calibration": 0.08,
    "csv": 0.10,
    "toml": 0.18,
    "formula": 0.415,
}
"""Of the inputs at each door with --total: more where one takes less time."""
NIGHTS: tuple[tuple[str, int], ...] = (
    ("pressure", 0),
    ("attitude", 0),
    ("attitude", 1),
    ("attitude", 12),
    ("attitude", 3),
)
"""Nights of `rig night` whose run files are changed: together they hold every kind of record."""
GIGABYTE, DEAF_S, TELL_S = 1 << 30, 60.0, 120.0
_PROGRESS = struct.Struct("qd")


def _work(door: str, first: int, last: int, material: Material, progress: mmap.mmap, results: Path) -> None:
    """In a process of its own: attack with the seeds from `first` to `last`; what is found is written as it is."""
    logging.disable(logging.WARNING)  # what libraries have to say about hostile files
    warnings.simplefilter("ignore")
    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    own_folder = material.folder / f"worker-{os.getpid()}"
    own_folder.mkdir()
    os.chdir(own_folder)
    material.folder = own_folder
    limited = False
    found = Found()
    with results.open("a") as file:
        for count, seed in enumerate(range(first, last + 1)):
            progress[:] = _PROGRESS.pack(seed, time.monotonic())
            if count == 50 and not limited:  # what is loaded when first used belongs to what it began with
                taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
                resource.setrlimit(resource.RLIMIT_AS, (taken + GIGABYTE, taken + GIGABYTE))
                limited = True
            attack(door, seed, material, found)
            if count % 500 == 499 or seed == last or found.wrong:
                file.write(json.dumps(asdict(found)) + "\n")
                file.flush()
                found = Found()


def campaign(door: str, first: int, inputs: int, material: Material, told: Found) -> float:
    """Attack one door; returns the processor time it took, seconds."""
    results = material.folder / f"{door}.jsonl"
    progress = mmap.mmap(-1, _PROGRESS.size)
    last, begin = first + inputs - 1, first
    spent = 0.0
    while begin <= last:
        progress[:] = _PROGRESS.pack(begin, time.monotonic())
        results.unlink(missing_ok=True)
        worker = os.fork()
        if not worker:
            code = 1
            with contextlib.suppress(BaseException):
                _work(door, begin, last, material, progress, results)
                code = 0
            os._exit(code)
        ended, deaf, said = 0, False, time.monotonic()
        while not ended:
            ended, status, used = os.wait4(worker, os.WNOHANG)
            if ended:
                break
            time.sleep(0.2)
            seed, since = _PROGRESS.unpack(progress[:])
            if time.monotonic() - said > TELL_S:
                said = time.monotonic()
                print(f"{door}: at seed {seed} of {first} to {last}", flush=True)
                _tell(results)
            if time.monotonic() - since > DEAF_S:
                deaf = True
                os.kill(worker, signal.SIGKILL)
        spent += used.ru_utime + used.ru_stime
        begin_was, begin = begin, last + 1
        if status:
            seed, _ = _PROGRESS.unpack(progress[:])
            if deaf:
                told.hangs += 1
                told.note("hang where no signal reaches it", f"--door {door} --seed {seed}")
            else:
                told.deaths += 1
                told.note(f"death of a process, status {status}", f"--door {door} --seed {seed}")
            begin = seed + 1
        counted = 0
        for line in results.read_text().splitlines() if results.exists() else ():
            counted += _add(told, json.loads(line))
        if status:  # those since it last wrote were done too
            told.inputs += seed - begin_was + 1 - counted
    return spent


def _tell(results: Path) -> None:
    """What was found so far."""
    for line in results.read_text().splitlines() if results.exists() else ():
        with contextlib.suppress(ValueError):  # half a line
            for what, example in json.loads(line)["examples"].items():
                print(f"  so far: {what}: {example.splitlines()[0]}", flush=True)


def _add(told: Found, more: dict[str, object]) -> int:
    for name in ("inputs", "tracebacks", "hangs", "memory", "deaths"):
        setattr(told, name, getattr(told, name) + more[name])
    for what, example in more["examples"].items():  # type: ignore[attr-defined]
        told.examples.setdefault(what, example)
    for what, count in more["counts"].items():  # type: ignore[attr-defined]
        told.counts[what] = told.counts.get(what, 0) + count
    return int(more["inputs"])  # type: ignore[call-overload,no-any-return]


def main() -> int:
    """As the command line says; 1 if anything was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=1000, help="for each door")
    parser.add_argument("--total", type=int, help="over all doors instead, shared out by what they cost")
    parser.add_argument("--seed", type=int, default=1, help="of the first input; the others count on from it")
    parser.add_argument("--door", choices=sorted(DOORS), action="append", help="only this one; repeatable")
    parser.add_argument("--jobs", type=int, default=1, help="doors at once")
    asked = parser.parse_args()
    doors = asked.door or list(SHARES)
    of_all = sum(SHARES[door] for door in doors)
    total = Found()
    rows = []
    began = time.monotonic()
    shared_memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=shared_memory if shared_memory.is_dir() else None) as folder:
        material = Material.make(Path(folder), NIGHTS)

        def one(door: str) -> tuple[str, Found, float, float]:
            inputs = asked.inputs if asked.total is None else round(asked.total * SHARES[door] / of_all)
            found, since = Found(), time.monotonic()
            spent = campaign(door, asked.seed, inputs, material, found)
            return door, found, time.monotonic() - since, spent

        with ThreadPoolExecutor(asked.jobs) as pool:
            for door, found, wall, spent in pool.map(one, doors):
                rows.append((door, found, wall, spent))
                print(_line(door, found, wall, spent), flush=True)
                for what, example in found.examples.items():
                    print(f"  {found.counts[what]} x {what}: {example}", flush=True)
                for name in ("inputs", "tracebacks", "hangs", "memory", "deaths"):
                    setattr(total, name, getattr(total, name) + getattr(found, name))
    print(f"\n| door | inputs | tracebacks | hangs beyond {HANG_S:g} s | beyond 1 GB | deaths | inputs/s |")
    print("|---|---|---|---|---|---|---|")
    everything = ("all", total, time.monotonic() - began, sum(row[3] for row in rows))
    for door, found, wall, _ in (*rows, everything):
        cells = (found.inputs, found.tracebacks, found.hangs, found.memory, found.deaths, round(found.inputs / wall))
        print(f"| {door} | " + " | ".join(f"{cell:,}" for cell in cells) + " |")
    print(f"{everything[2]:.0f} s, {everything[3]:.0f} s of processor time; seeds from {asked.seed}")
    return 1 if total.wrong else 0


def _line(door: str, found: Found, wall: float, spent: float) -> str:
    return (
        f"{door}: {found.inputs:,} inputs in {wall:.0f} s ({spent:.0f} s of processor time), "
        f"{found.tracebacks} tracebacks, {found.hangs} hangs, {found.memory} beyond 1 GB, {found.deaths} deaths"
    )


if __name__ == "__main__":
    sys.exit(main())
