"""What a trace said of a table whose hidden causes are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from proving.strangers.judge import Judged

RIGHT: Final = "right"
RIGHT_MARKED: Final = "right, doubtful or aliased"
UNNAMED: Final = "unnamed only"
DOUBTFUL: Final = "doubtful only"
WRONG_MARKED: Final = "wrong with a mark"
WRONG: Final = "WRONG WITHOUT A MARK"
SILENT: Final = "silent"
NOISE: Final = "noise only"
REFUSED: Final = "refused"
CRASH: Final = "crash"
CLASSES: Final = (RIGHT, RIGHT_MARKED, UNNAMED, DOUBTFUL, WRONG_MARKED, WRONG, SILENT, NOISE, REFUSED, CRASH)
"""Every run is of one class."""

DIFFER: Final = "between replications: the parameters drift"
"""A place of the trace: replications differ. Sets have laboratories where they do, so it is no mark of a name."""
ERRORS: Final = ("sigma_E", "sigma_subplot", "sigma_wholeplot")


@dataclass(frozen=True)
class Name:
    """An effect that was named of one sensor."""

    name: str
    doubtful: str | None
    aliases: tuple[str, ...]


@dataclass(frozen=True)
class Said:
    """What was said of one sensor.

    Attributes:
        sensor: its name.
        verdict: of the trace.
        names: effects.
        unnamed: places where something is without a name.
        noise: findings about the noise.
        differ: whether replications are said to differ.
        rose: whether the error is larger after than before.
        left_out_rose: whether the error on rows left out is; None where nobody asked.

    """

    sensor: str
    verdict: str
    names: tuple[Name, ...]
    unnamed: tuple[str, ...]
    noise: tuple[str, ...]
    differ: bool
    rose: bool
    left_out_rose: bool | None


def said_of(told: Mapping[str, Any]) -> list[Said]:
    """From the JSON values of `rig trace`."""
    return [_said(name, one) for name, one in told["sensors"].items()]


def _said(sensor: str, one: Mapping[str, Any]) -> Said:
    effects = [Name(e["effect"], e["doubtful"], tuple(e["aliases"])) for e in one["effects"] if e["stratum"] != "noise"]
    unnamed = [u for u in one["unnamed"] or () if u["stratum"] != "noise"]
    noise = [e["effect"] for e in one["effects"] if e["stratum"] == "noise"]
    noise += [u["where"] for u in one["unnamed"] or () if u["stratum"] == "noise"]
    before, after = (_error(one[when], ERRORS) for when in ("before", "after"))
    out_before, out_after = (_error(one[when], ("cv_rms",)) for when in ("before", "after"))
    differ = any(u["where"] == DIFFER for u in unnamed)
    places = tuple(str(u["where"]) for u in unnamed if u["where"] != DIFFER)
    rose, left_out_rose = _above(after, before), _above(out_after, out_before)
    return Said(sensor, one["verdict"], tuple(effects), places, tuple(noise), differ, bool(rose), left_out_rose)


def _error(rows: Mapping[str, Any], names: Sequence[str]) -> float | None:
    values = [rows[name] for name in names if isinstance(rows.get(name), float)]
    return sum(value**2 for value in values) ** 0.5 if values else None


def _above(after: float | None, before: float | None) -> bool | None:
    return None if after is None or before is None else after > before * (1 + 1e-9)


def class_of(said: Sequence[Said], hidden: Sequence[Judged]) -> str:
    """The class of a run, by its worst sensor.

    A name is right if the judge's list of a hidden cause has it; *aliased* if one of its aliases is right and it is
    not. A mark is a doubt of a name, or something unnamed, in the same sensor.
    """

    def right(name: str) -> bool:
        return any(one.names(name) for one in hidden)

    def admitted(one: Name) -> bool:
        return right(one.name) or any(map(right, one.aliases))

    wrong = [(s, n) for s in said for n in s.names if not admitted(n)]
    plain = [s for s, n in wrong if n.doubtful is None]
    names = [n for s in said for n in s.names]
    of_noise = [name for s in said for name in s.noise if right(name)]
    if plain:
        marked = all(s.unnamed or any(n.doubtful is not None for n in s.names) for s in plain)
        return WRONG_MARKED if marked else WRONG
    if wrong:
        sure = [n for n in names if n.doubtful is None and admitted(n)]
        return RIGHT_MARKED if sure or of_noise else DOUBTFUL
    if names or of_noise:
        return RIGHT if all(n.doubtful is None and right(n.name) for n in names) else RIGHT_MARKED
    if any(s.unnamed for s in said):
        return UNNAMED
    return NOISE if any(s.noise or s.differ for s in said) else SILENT


def found(said: Sequence[Said], hidden: Sequence[Judged]) -> list[bool]:
    """Of each hidden cause, whether a name or an alias of one is right for it."""
    every = [name for s in said for n in s.names for name in (n.name, *n.aliases)]
    every += [name for s in said for name in s.noise]
    return [any(map(one.names, every)) for one in hidden]


def unmarked_in_the_run(said: Sequence[Said], hidden: Sequence[Judged]) -> bool:
    """Whether a wrong name stands and nothing is marked in any sensor of the run."""
    marked = any(s.unnamed or any(n.doubtful is not None for n in s.names) for s in said)
    return not marked and class_of(said, hidden) == WRONG


def alarm(said: Sequence[Said]) -> bool:
    """Whether anything is named or unnamed; findings about the noise are none of it."""
    return any(s.names or s.unnamed or s.differ for s in said)


def only_differ(said: Sequence[Said]) -> bool:
    """Whether all that is said is that replications differ."""
    return any(s.differ for s in said) and not any(s.names or s.unnamed for s in said)


def line_of(said: Sequence[Said]) -> str:
    """All of it in one line."""
    parts = []
    for s in said:
        words = [_words(n) for n in s.names]
        words += [f"unnamed <{place}>" for place in s.unnamed] + [f"noise <{name}>" for name in s.noise]
        words += [f"unnamed <{DIFFER}>"] if s.differ else []
        words += ["the error ROSE"] if s.rose else []
        parts.append(f"{s.sensor} {s.verdict}: {'; '.join(words) or 'nothing'}")
    return " | ".join(parts)


def _words(one: Name) -> str:
    aliases = f" (aliases {', '.join(one.aliases)})" if one.aliases else ""
    return f"{one.name}{aliases}" + (f" DOUBTFUL [{one.doubtful}]" if one.doubtful is not None else "")
