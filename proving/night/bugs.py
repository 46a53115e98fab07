"""Bugs to plant: a campaign that finds nothing proves nothing until it is seen to find these.

Each is a mistake that somebody could make in the controller, put in place while a night is played.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any
from unittest.mock import patch

from rig.bench.scatter_limits import most_scatter
from rig.drivers.declared.reader import DeclaredReader
from rig.drivers.wires import SerialLine
from rig.engine import at_point, sequencer
from rig.engine.by_hand.to_set import SetByHand
from rig.engine.guard import Guard
from rig.engine.holes import WatchedClock
from rig.engine.journal import Journal
from rig.engine.whole_plots import WholePlots
from rig.procedures.plan.run_list import Factor, Point
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed


@contextlib.contextmanager
def _all(*patches: AbstractContextManager[Any]) -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        for one in patches:
            stack.enter_context(one)
        yield


def _accept_late_reply() -> AbstractContextManager[Any]:
    """A line that does not listen before it speaks, and meters whose measurements bear no mark."""

    def unmarked(self: Any, count: int) -> dict[str, list[tuple[str, float]]]:
        names, line = self.channels(), self._talk.line
        self._clock.sleep(self._due - self._clock.now())
        answer = line.query("FETC?", 2.0 + count * len(names) * 16 * 11 / line.settings.baud, repeat=False)
        values = [("", float(word)) for word in answer.split(",")]
        if len(values) != count * len(names):
            raise line.bad_reply("FETC?", answer, "numbers")
        return {name: values[i :: len(names)] for i, name in enumerate(names)}

    def deaf(self: Any, *_: object) -> None:
        self._out_of_step = self._owed = False

    return _all(
        patch.object(SerialLine, "drain", deaf),
        patch.object(SerialLine, "_synchronise", deaf),
        patch.object(DeclaredReader, "_block", unmarked),
    )


def _skip_re_approach() -> AbstractContextManager[Any]:
    """After an interruption straight to the point, from whichever side, and nobody looks which it was."""

    def straight(
        factors: Sequence[Factor], point: Point, _: Point | None, axes: Collection[str]
    ) -> list[dict[str, float]]:
        return [{f.axis: setpoint for f, setpoint in zip(factors, point.setpoints, strict=True) if not f.hard}]

    return _all(
        patch.object(at_point, "recovery_legs", straight),
        patch.object(at_point.AtPoint, "_assert_undisturbed", lambda *_: None),
    )


def _double_write() -> AbstractContextManager[Any]:
    """An observation is written twice."""
    write = Journal.write

    def twice(self: Journal, event: Event, **options: Any) -> None:
        write(self, event, **options)
        if isinstance(event, Observed):
            write(self, event, **options)

    return patch.object(Journal, "write", twice)


def _ignore_alarm() -> AbstractContextManager[Any]:
    """A chamber's alarms are read and not heeded."""
    return patch.object(Guard, "check_chamber", lambda *_: None)


def _vent_on_resume() -> AbstractContextManager[Any]:
    """Every session begins by bringing all to its safe state, and so changes what it is to go on with."""
    checking = sequencer.Sequencer._checking

    def safe_first(self: Any) -> str:
        self._way_out.make_safe()
        return checking(self)

    return patch.object(sequencer.Sequencer, "_checking", safe_first)


def _stale_reading() -> AbstractContextManager[Any]:
    """A meter hands out the readings of the point before."""
    fetch, before = DeclaredReader.fetch, dict[int, Any]()

    def late(self: Any) -> Any:
        fresh = fetch(self)
        stale = before.get(id(self), fresh)
        before[id(self)] = fresh
        return stale if {c: len(v) for c, v in stale.items()} == {c: len(v) for c, v in fresh.items()} else fresh

    return patch.object(DeclaredReader, "fetch", late)


def _whole_plot_goes_on() -> AbstractContextManager[Any]:
    """A whole plot is continued whatever happened meanwhile."""
    return _all(
        patch.object(WholePlots, "lost_meanwhile", lambda *_, **__: ""),
        patch.object(WholePlots, "lost_now", lambda *_, **__: ""),
    )


def _sleep_through() -> AbstractContextManager[Any]:
    """A controller that had no turn for a while goes on as if nothing had been."""
    return patch.object(WatchedClock, "take_hole", lambda _: None)


def _weights_from_any_side() -> AbstractContextManager[Any]:
    """A person is asked for the setting itself, whatever stood before, and nobody looks from which side it came."""

    def any_side(self: Any, factor: Factor, target: float, _side: int) -> float | None:
        stands = self._stands.get(factor.name)
        return None if stands is not None and stands.setpoint == target else target

    return patch.object(SetByHand, "_next", any_side)


def _trust_standards() -> AbstractContextManager[Any]:
    """Nobody looks at the scatter of what a reference standard reads."""
    limits = most_scatter

    def of_outputs(conduct: Any, config: Any) -> Any:
        return {name: most for name, most in limits(conduct, config).items() if name not in config.references}

    return patch.object(at_point, "most_scatter", of_outputs)


BUGS: Mapping[str, Callable[[], AbstractContextManager[Any]]] = {
    "accept-late-reply": _accept_late_reply,
    "skip-re-approach": _skip_re_approach,
    "double-write": _double_write,
    "ignore-alarm": _ignore_alarm,
    "vent-on-resume": _vent_on_resume,
    "stale-reading": _stale_reading,
    "whole-plot-goes-on": _whole_plot_goes_on,
    "sleep-through": _sleep_through,
    "weights-from-any-side": _weights_from_any_side,
    "trust-standards": _trust_standards,
}
