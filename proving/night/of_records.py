"""What must hold of a run file and of the sessions that wrote it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

from proving.night.judged import Night
from proving.night.play import MOST_SESSIONS
from rig.run_file.events.points import Observed, Skipped, WholePlotBegan, WholePlotLost
from rig.run_file.live import live_path


def complete(night: Night) -> Iterator[str]:
    """The run is finished, and nothing of it left behind."""
    played = night.played
    if not played.complete:
        last = played.sessions[-1]
        yield f"not complete after {MOST_SESSIONS} sessions; the last was {last.how}: {last.message}"
    elif live_path(played.path).exists():  # type: ignore[arg-type]
        yield "the live state was left behind"


def misread_identity(night: Night) -> str:
    """Why a run that refuses its own instrument could not know better; "" if it could.

    An identity is asked again until two answers in a row are the same. Where both arrive changed, and alike, it is
    written down so, and the true one of a later session is that of another instrument. It may be: a serial number with
    a digit more is one that another instrument has. So a person decides (`rig resume --accept`), and a night has none.
    """
    refused = _REFUSED.search(night.played.sessions[-1].message)
    if refused is None:
        return ""
    arrived = [
        found[1]
        for one in night.played.bench.sim.faults.happened
        if one.fault.on == refused[1] and (found := _ARRIVED.search(one.what))
    ]
    if any(before == after and refused[2] in after for before, after in pairwise(arrived)):
        return "an identity arrived changed twice in succession, and alike"
    return ""


_REFUSED = re.compile(r"^(\S+) is another instrument than before \(was .*?, ([^,]+); is ")
_ARRIVED = re.compile(r" arrives as '(.*)'")


def accounted(night: Night) -> Iterator[str]:
    """Every point of the run list, in the whole plot that counts, once: observed, or given up for a stated reason."""
    observed, skipped = Counter[tuple[int, int | None]](), dict[int, str]()
    lost, planned = set[int](), dict[int, int]()
    for r in night.records:
        match r.event:
            case Observed(accepted=True):
                assert r.run_index is not None
                observed[r.run_index, r.whole_plot] += 1
            case Skipped(final=True) as skip:
                assert r.run_index is not None
                skipped[r.run_index] = skip.reason
            case WholePlotBegan() as began:
                assert r.whole_plot is not None
                planned[r.whole_plot] = began.planned
            case WholePlotLost() as gone:
                assert r.whole_plot is not None
                lost.add(r.whole_plot)
                for index in gone.points:
                    skipped.pop(index, None)
    if not night.played.complete:
        return
    for (index, identity), times in observed.items():
        if times > 1:
            yield f"point {index} was accepted {times} times in whole plot {identity}"
    for p in night.run_list.points:
        counts = [n for (index, identity), n in observed.items() if index == p.index and identity not in lost]
        if sum(counts) + (p.index in skipped) != 1:
            yield f"point {p.index} has {sum(counts)} accepted observations" + (
                " and was skipped" if p.index in skipped else ""
            )
        if p.index in skipped and not skipped[p.index]:
            yield f"point {p.index} was skipped without a reason"
    for identity, plan in planned.items():
        wrong = [i for (i, w) in observed if w == identity and night.run_list.points[i].whole_plot != plan]
        if wrong:
            yield f"point {wrong[0]} was observed in a measurement of whole plot {plan}, which is not its own"


def in_order(night: Night) -> Iterator[str]:
    """Elapsed time never runs backwards, whatever the clocks of the machine do."""
    before = 0.0
    for r in night.records:
        if r.elapsed_s < before - 1e-6:
            yield f"a {r.kind} at {r.elapsed_s:.3f} s follows one at {before:.3f} s"
            return
        before = r.elapsed_s


def foreseen(night: Night) -> Iterator[str]:
    """No session ends in an error that nobody foresaw."""
    for ended in night.played.sessions:
        if ended.how == "unforeseen":
            yield ended.message
