"""Many nights: played, judged, counted; a night that fails is named by its seed and replays exactly."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from proving.ledger import Result
from proving.night.bias import deviations
from proving.night.bugs import BUGS
from proving.night.checks import judge
from proving.night.judged import Violation
from proving.night.play import Played, play
from proving.night.scenario import Scenario, Size, draw
from proving.night.story import timeline
from proving.seeds import Campaign

Bench = Mapping[str, str] | None
"""See `proving.night.scenario.draw`."""

_MEMORY = "/dev/shm"
"""Where run files of nights lie: their durability is the disk's part of a night, not this machine's."""


@dataclass(frozen=True)
class Verdict:
    """One night, judged.

    Attributes:
        seed, lab: which.
        violations: what did not hold, but for what nobody could know.
        unknowable: that.
        sessions: how often the controller was started.
        happened: faults and mishaps that met anything.
        complete: whether the run was finished.
        bench_s: bench time.
        skipped: points given up for a reason.
        deviations: (quantity, t, degrees of freedom) of what was calibrated.

    """

    seed: int
    lab: str
    violations: tuple[Violation, ...]
    sessions: int
    happened: int
    complete: bool
    bench_s: float
    skipped: int
    deviations: tuple[tuple[str, float, float], ...]
    unknowable: tuple[Violation, ...] = ()

    @classmethod
    def of(cls, result: Result) -> Verdict:
        """From what `nights` gave as JSON."""
        of = {key: tuple(Violation(**one) for one in result[key]) for key in ("violations", "unknowable")}
        off = tuple((quantity, t, df) for quantity, t, df in result["deviations"])
        return cls(**{**result, **of, "deviations": off})


def one_night(
    seed: int, lab: str, *, size: Size = "short", bug: str = "", calm: bool = False, bench: Bench = None
) -> Verdict:
    """Play and judge one night; `bug` plants one of `BUGS` in the controller first, the rest is as in `draw`."""
    return _judged(draw(seed, lab, size=size, calm=calm, bench=bench), bug, lambda _: None)


def replay(
    seed: int, lab: str, folder: Path, *, size: Size = "short", bug: str = "", calm: bool = False, bench: Bench = None
) -> tuple[Verdict, list[str]]:
    """The same, its files left in `folder`, with what happened in order of time."""
    told: list[str] = []
    scenario = draw(seed, lab, size=size, calm=calm, bench=bench)
    verdict = _judged(scenario, bug, lambda played: told.extend(timeline(played)), folder)
    return verdict, told


def _judged(scenario: Scenario, bug: str, look: Callable[[Played], None], folder: Path | None = None) -> Verdict:
    here = _MEMORY if Path(_MEMORY).is_dir() else None
    with tempfile.TemporaryDirectory(dir=here) if folder is None else nullcontext(str(folder)) as place:
        with BUGS[bug]() if bug else nullcontext():
            played = play(scenario, Path(place))
        try:
            found = judge(played)
            violations = tuple(one for one in found if not one.unknowable)
            look(played)
            off = tuple(deviations(played)) if played.complete and not violations else ()
            skipped = played.skipped()
        finally:
            played.bench.close()
    return Verdict(
        scenario.seed,
        scenario.lab,
        violations,
        len(played.sessions),
        len(played.happened),
        played.complete,
        played.bench.world.now(),
        skipped,
        off,
        tuple(one for one in found if one.unknowable),
    )


def nights(lab: str, *, size: Size = "short", bug: str = "", calm: bool = False, bench: Bench = None) -> Campaign:
    """Nights of a laboratory as a campaign of seeds, for `proving.seeds`; its results are verdicts as JSON."""
    whose = "" if bench is None else f" on a bench of its own: {json.dumps(bench, sort_keys=True)}"
    kinds = f"{size}{f' with {bug}' if bug else ''}{' calm' if calm else ''}"
    one = partial(_as_json, lab=lab, size=size, bug=bug, calm=calm, bench=bench)
    return Campaign(one, f"{kinds} nights: {lab}{whose}", block=_BLOCKS[size])


_BLOCKS: Mapping[Size, int] = {"brief": 8, "short": 8, "full": 1}
"""Nights in a block: seconds, but for full ones."""


def _as_json(seed: int, lab: str, *, size: Size, bug: str, calm: bool, bench: Bench) -> Result:
    return asdict(one_night(seed, lab, size=size, bug=bug, calm=calm, bench=bench))


@dataclass(frozen=True)
class Bias:
    """What many nights say together of the calibrations that came of them.

    Attributes:
        quantities: how many coefficients.
        mean: of their deviations from the truth, each made standard normal by its own t distribution.
        sd: of these.
        largest: of them.
        own_sd: that the method has where nothing goes wrong.

    """

    quantities: int
    mean: float
    sd: float
    largest: float
    own_sd: float

    @property
    def holds(self) -> bool:
        """Whether mean and scatter are those of nights without trouble, as chance has it once in 30,000 times."""
        root = math.sqrt(self.quantities)
        return abs(self.mean) * root < _CHANCE and (self.sd - self.own_sd) * root * math.sqrt(2.0) < _CHANCE

    def __str__(self) -> str:
        """In words."""
        return (
            f"coefficients less the truth, over their standard errors: mean {self.mean:+.3f}, sd {self.sd:.3f} "
            f"({self.quantities} of them)"
        )


_CHANCE = 4.0
_OWN_SD: Mapping[str, float] = {"pressure": 1.02}
"""Standard deviation that the method itself has: for four whole plots degrees of freedom are an approximation, and calm
nights have this (proving/notes/nights.md)."""


def unbiased(deviations: Iterable[tuple[str, float, float]], lab: str) -> Bias | None:
    """Deviations of many nights of a laboratory taken together; None where there are none."""
    from scipy.special import ndtri, stdtr  # noqa: PLC0415 - slow to import

    z = [-float(ndtri(stdtr(df, -t))) for _, t, df in deviations]
    if not z:
        return None
    mean = sum(z) / len(z)
    sd = (sum((one - mean) ** 2 for one in z) / len(z)) ** 0.5
    return Bias(len(z), mean, sd, max(map(abs, z)), _OWN_SD.get(lab, 1.0))
