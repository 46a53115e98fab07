"""The person at a simulated bench: does what is asked for after some time, as the world file says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig.instruments.person_at_bench import SIMULATED

if TYPE_CHECKING:
    from rig.bench.typed import TypedColumn
    from rig.procedures.plan.hand_steps import HandStep
    from rig.sims.bench import SimBench


class SimulatedPerson:
    """Does steps by hand in the simulated bench; see `rig.instruments.person_at_bench.Person`.

    Args:
        sim: the bench.

    """

    def __init__(self, sim: SimBench) -> None:
        self._sim, self._truth = sim, sim.plant.truth.person
        self._step: HandStep | None = None
        self._due_s = 0.0
        self._setting: tuple[str, float] | None = None
        self._dial: TypedColumn | None = None

    def asked_to_set(self, factor: str, value: float) -> bool:
        """The person reads to what a factor has to be set."""
        self._step, self._setting, self._dial = None, (factor, value), None
        self._due_s = self._sim.world.now() + self._truth.sets_s
        return self._truth.comes

    def asked(self, step: HandStep) -> bool:
        """The person reads what to do."""
        self._setting = self._dial = None
        self._step, self._due_s = step, self._sim.world.now() + self._truth.after_s
        return self._truth.comes

    def asked_to_read(self, column: TypedColumn) -> bool:
        """The person reads what to read."""
        self._step = self._setting = None
        self._dial, self._due_s = column, self._sim.world.now() + self._truth.reads_s
        return self._truth.comes

    def answer(self) -> tuple[str | None, str] | None:
        """Stated value and name, once the step is done; None before."""
        step = self._step
        if self._sim.world.now() < self._due_s:
            return None
        if self._setting is not None:
            factor, value = self._setting
            self._setting = None
            self._sim.plant.set_by_hand(factor, value)
            return None, SIMULATED
        if self._dial is not None:
            column, self._dial = self._dial, None
            return column.seen(self._sim.reads(column.reader, column.channel)), SIMULATED
        if step is None:
            return None
        self._step = None
        number = self._states(step) if step.value else None
        stated = None if number is None else repr(number)
        if not step.refuses(stated):
            self._sim.by_hand(step.change, number)
        return stated, SIMULATED

    def _states(self, step: HandStep) -> float:
        """The number of the world file; without one the middle of the step's range, 0 where it has none."""
        if self._truth.states is not None:
            return self._truth.states
        return 0.0 if step.low is None or step.high is None else 0.5 * (step.low + step.high)

    def recall_setting(self, factor: str, value: float) -> None:
        """A real person has set a factor of a simulated bench."""
        self._setting = None
        self._sim.plant.set_by_hand(factor, value)

    def recall(self, change: str, number: float | None) -> None:
        """A step was done in an earlier session: the bench is still changed."""
        self._sim.by_hand(change, number)

    def done(self, change: str, number: float | None) -> None:
        """A real person has done a step at a simulated bench."""
        self._sim.by_hand(change, number)
