"""Whether the instruments are as the bench file declares, asked before and after the readings of every point.

A unit or a channel that is changed at a panel changes every reading after it, and no reading tells. So the instruments
that can tell are asked (`rig.drivers.roles.SelfChecking`). Readings since the last good answer are not used. What
readers have learned of their instruments is kept in the run file, so that a resumed run decides as if it had never
stopped.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from rig.engine.actions import BenchActions
from rig.engine.fault_classes import TOLD_LATER, NotAsDeclared
from rig.engine.journal import Journal, PointInHand
from rig.engine.measuring import Observation
from rig.run_file.events.bench import Learned, Warned
from rig.run_file.events.points import DOUBTED, Observed


class Wellness:
    """Asks the instruments of a bench.

    Args:
        do: actions on the bench.
        journal: where it is recorded.

    """

    def __init__(self, do: BenchActions, journal: Journal) -> None:
        self._do, self._journal = do, journal
        do.recall(journal.fold.learned)

    def ask(self, at: PointInHand, observation: Observation | None = None) -> None:
        """Ask the instruments whether they are set as declared, and well.

        Args:
            at: the current point.
            observation: readings since they were asked last; None before readings.

        Raises:
            NotAsDeclared: one is not; its evidence has the readings.

        """
        found = self._do.not_as_declared()
        if found is None:
            at.began_well = True
            return
        name, said = found
        words = f"{said}: somebody has changed it, or it is not well"
        if observation is None:
            raise NotAsDeclared(name, 0, words)
        error = NotAsDeclared(name, 0, f"{words}; the readings since it was last asked are not used")
        error.evidence = {"readings": observation.in_range()}
        raise error

    def doubt_last(self, error: Exception) -> None:
        """Flag the last accepted observation if an instrument tells of a defect only now, before the next readings."""
        at, fold = self._journal.at, self._journal.fold
        last = fold.last_index
        if not isinstance(error, TOLD_LATER) or last is None or last in fold.doubted or (at and at.began_well):
            return
        words = f"point {last} is doubted: after its readings an instrument told of a defect that may be older: {error}"
        self._journal.write(Warned(DOUBTED, "", words, last))

    def doubt_repeated(self, hanging: Collection[str], read: Mapping[str, Sequence[float]]) -> None:
        """Flag the last accepted observation if all its readings of a column are those at which the column now hangs.

        From the first reading on, nothing tells a meter that hangs from one that is coarse, until it is set elsewhere.
        """
        fold, (last, *_) = self._journal.fold, (*self._journal.recent(1), None)
        if last is None or last.run_index in fold.doubted or not isinstance(last.event, Observed):
            return
        then = last.event.every_reading
        same = [n for n in hanging if n in then and {*then[n]} == {*read[n]}]
        if same:
            words = f"point {last.run_index} is doubted: {', '.join(same)} hung there already, at {read[same[0]][0]:g}"
            self._journal.write(Warned(DOUBTED, "", words, last.run_index))

    def learned(self) -> list[Learned]:
        """Knowledge of readers that is new since the last point."""
        known = self._journal.fold.learned
        return [Learned(instrument=n, learned=what) for n, what in self._do.learned().items() if what != known.get(n)]
