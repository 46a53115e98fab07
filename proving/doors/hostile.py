"""What doors are attacked with: values, ways to change texts and JSON, the files that are changed, commands to run."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import typer

from proving.crashes.damages import small_finished
from proving.night.campaign import replay
from rig.cli.commands import app
from rig.errors import RigError
from rig.procedures.errors import DataError

Acts = Iterator[Callable[[], object]]
"""What a door is asked to do, one call at a time."""


class Wrong(Exception):
    """An answer that nobody should get."""


VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, -(2**63), 10**400, 1e308, -1e308, 1e-320, 0.5, 1e12, -0.0),
    *(float("nan"), float("inf"), float("-inf")),
    *("", "x", "=1+1", "a\nb", "\0", "../../etc/passwd", "x" * 5000, "1_5", "\ud800", "\u202e", "C(", "2026-01-01"),
    *("[red]", "[/]", "%s{0}", "<script>", "\x1b[2J", "nan", "1e999", "\uff11"),
    *([], {}, [[]], {"a": 1}, [1, "x", None], [{}] * 3, {"name": {"a": 1}}, [0.5] * 300, {"": ""}, [None], ["x"] * 3),
)
TOML_VALUES = (
    *("-1", "0", "1e308", "-1e308", "1e-320", "nan", "inf", "-inf", "1" * 5000, "0x" + "f" * 5000, "1000000000"),
    *("99999999999", "1_000_000", "1_5", "true", "false", '""', "0.5", "2", "9223372036854775807", "-0.0", "10000"),
    *('"x"', '"\\u0000"', '"a\\nb"', '"=1+1"', "[" * 3000, "[]", "{}", "{a = 1}", "[[1, 2], [3]]", "1979-05-27"),
    *('"spy:///dev/null?file=/tmp/x"', '"socket://[::1"', '"socket://a\\u0000b:1"', '"/dev/ttyS\\u0000"', '"\\ud83d"'),
    *("a" + ".a" * 2000, '"' + "x" * 5000 + '"', "[1, 1]", '"\\u202e"', '"../../x"', '["x", 1]', "[0.0, 0.0]", '[""]'),
    *('"alloc://"', '"rfc2217://[::1]:x"', '"C(" ', "{a = {a = {a = 1}}}", "1979-05-27T00:32:00-07:00", "[nan, inf]"),
)


class Seeded(random.Random):
    """Random choices from a door's name and a number."""

    def __init__(self, door: str, number: int) -> None:
        super().__init__(f"{door} {number}")
        self.number = number


@dataclass
class Material:
    """What is mutated: finished runs, a calibration of each, and a folder to write to.

    Attributes:
        run: a finished attitude run.
        runs: it, and others with more that happened.
        calibrations: what `rig fit --out` wrote of some.
        folder: to write to.
        made: what a door makes once and keeps: images of runs, servers.

    """

    run: Path
    runs: list[Path]
    calibrations: list[dict[str, Any]]
    folder: Path
    made: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def make(cls, folder: Path, nights: tuple[tuple[str, int], ...] = (("pressure", 0),)) -> Material:
        """Make a small run and some nights full of faults, by laboratory and seed; see `rig night`."""
        run = small_finished("attitude", folder / "whole")
        runs = [run]
        for lab, seed in nights:
            kept = folder / f"{lab}-{seed}"
            kept.mkdir()
            replay(seed, lab, kept)
            runs.append(next(iter(kept.glob("*.sqlite"))))
        calibrations = []
        for number, one in enumerate(runs):
            out = folder / f"calibration{number}.json"
            with contextlib.suppress(RigError, DataError, SystemExit):
                command("fit", one, "--out", out)
            if out.exists():
                calibrations.append(json.loads(out.read_text()))
        return cls(run, runs, calibrations, folder)

    def close(self) -> None:
        """End the servers that doors began."""
        for one in (*self.made.pop("pages", ()), *filter(None, [self.made.pop("answering", None)])):
            one.close()

    def path(self, name: str) -> Path:
        """A path of which nothing is left from an earlier input."""
        stem = Path(name).stem
        with os.scandir(self.folder) as entries:
            for old in [entry for entry in entries if entry.name.startswith(stem)]:
                if old.is_dir(follow_symlinks=False):
                    shutil.rmtree(old.path)
                else:
                    os.unlink(old.path)
        return self.folder / name


def mutated(value: Any, rng: random.Random) -> Any:
    """A JSON value with one place in it changed."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = rng.choice(list(value))
        match rng.randrange(12):
            case 0:
                return {k: v for k, v in value.items() if k != key}
            case 1:
                return {(rng.choice(("", "x", "=1", "a\nb")) if k == key else k): v for k, v in value.items()}
        return {**value, key: mutated(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.9:
        at = rng.randrange(len(value))
        match rng.randrange(12):
            case 0:
                return value[:at] + value[at + 1 :]
            case 1:
                return [*value, value[at]]
        return [*value[:at], mutated(value[at], rng), *value[at + 1 :]]
    if isinstance(value, int | float) and not isinstance(value, bool) and rng.random() < 0.2:
        return rng.choice((-value, value + 1, value * 1_000_000, str(value), [value], bool(value), int(value * 0 == 0)))
    return rng.choice(VALUES)


def edited(text: str, rng: random.Random, values: tuple[str, ...] = TOML_VALUES) -> str:
    """A text of lines `name = value` with some of them changed."""
    lines = text.splitlines() or [""]
    for _ in range(rng.randrange(1, 4)):
        at = rng.randrange(len(lines))
        how = rng.randrange(7)
        if how < 4 and "=" in lines[at]:
            lines[at] = f"{lines[at].partition('=')[0]}= {rng.choice(values)}"
        elif how == 4:
            lines.insert(at, rng.choice(lines))
        elif how == 5 and len(lines) > 1:
            del lines[at]
        else:
            lines[at] = lines[at].replace(rng.choice("=[]\"'. "), rng.choice(("", "\0", "[[", ".", "\n", '"')), 1)
    return "\n".join(lines)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Bytes with some of them changed, taken away or doubled."""
    data = bytearray(content)
    for _ in range(rng.randrange(1, 5)):
        at = rng.randrange(len(data) + 1)
        match rng.randrange(5):
            case 0 if data:
                data[at % len(data)] ^= 1 << rng.randrange(8)
            case 1:
                del data[at : at + rng.randrange(1, 40)]
            case 2:
                data[at:at] = rng.randbytes(rng.randrange(1, 20))
            case 3:
                data[at:at] = rng.choice((b"\r\n", b"\0", b"\xff", b"[" * 3000, b"9" * 5000, b"\n", b" ", b'"', b"\r"))
            case _:
                data[at:at] = data[at : at + rng.randrange(1, 60)]
    return bytes(data)


@cache
def _program() -> Any:
    """All commands; making them takes longer than most of them do."""
    return typer.main.get_command(app)


class NotJson(Exception):
    """What a command printed with `--json` is not JSON."""


def command(*arguments: object) -> str:
    """What a command prints. Raises what it raises, and `NotJson`."""
    said, told = _Terminal(), _Terminal()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told):
        _program().main([str(a) for a in arguments], standalone_mode=False)
    text = said.text()
    if "--json" in arguments and text.strip():
        check_json(text)
    return text


class _Terminal(io.TextIOWrapper):
    """Where a program prints to: UTF-8, and nothing that it does not have."""

    def __init__(self) -> None:
        super().__init__(io.BytesIO(), encoding="utf-8", errors="surrogateescape", newline="")

    def text(self) -> str:
        self.flush()
        return str(self.buffer.getvalue().decode(errors="surrogateescape"))  # type: ignore[attr-defined]


def check_json(text: str) -> None:
    """Raise `NotJson` for what no JSON reader takes: NaN, infinity, half characters."""

    def refused(word: str) -> None:
        raise NotJson(f"{word} is not JSON")

    try:
        json.loads(text, parse_constant=refused)
        text.encode()
    except ValueError as error:
        raise NotJson(str(error)) from error


def words(rng: random.Random, choices: tuple[str, ...], most: int) -> Iterator[str]:
    """A few words."""
    return (rng.choice(choices) for _ in range(rng.randrange(1, most)))
