"""Faults of instruments, of what is behind them, and of the clock."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, Protocol

from sims.faults.fault import Fault
from sims.faults.readings import tamper_with
from sims.faults.wire import FaultyWire
from sims.physics import Plant
from sims.world import World


class Bench(Protocol):
    """What faults need of a simulated bench."""

    world: World
    plant: Plant

    def twin(self, name: str) -> Any:
        """The twin of an instrument."""
        ...

    def wire(self, name: str) -> FaultyWire:
        """Its wire."""
        ...


class Acts:
    """Makes faults happen that are not of a wire; see `sims.faults.schedule.Act`."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def __call__(self, fault: Fault, until: float, note: Callable[[str], None]) -> Callable[[], None] | None:
        """See `sims.faults.schedule.Act`."""
        bench, now = self._bench, self._bench.world.now()
        match fault.kind:
            case "clock-step":
                amount = fault.number("amount_s")
                bench.world.step_utc(amount)
                note(f"UTC stepped by {amount:+g} s")
                return lambda: bench.world.step_utc(-amount)
            case "dst":
                amount = fault.number("amount_s")
                bench.world.local_offset_s += amount
                note(f"local time moved by {amount:+g} s; UTC did not")

                def back() -> None:
                    bench.world.local_offset_s -= amount

                return back
        twin = bench.twin(fault.on)
        match fault.kind:
            case "drive-fault" | "following-error":
                note(f"{fault.options['axis']}: {twin.trip(fault.word('axis'), fault.kind)}")
            case "stall":
                bench.plant.head.axes[fault.word("axis")].stall(until)
                note(f"{fault.options['axis']} stalls until {until:.3f} s")
            case "slip":
                amount, sees = fault.number("amount_deg"), fault.options["encoder"] == "sees"
                bench.plant.head.axes[fault.word("axis")].slip(amount, encoder=sees)
                also = "and so did its encoder" if sees else "its encoder did not"
                note(f"{fault.options['axis']} jumped by {amount:+g} deg; {also}")
            case "error-queue-overflow":
                twin.overflow_errors()
                note("the error queue ran over")
            case "power-cycle":
                return self._power_cycle(fault, twin, until, note)
            case "supply-failure":
                source = fault.word("source")
                line = bench.plant.pressure_line(fault.on)
                line.lose(now, source, until, fault.number("supply_psia") if source == "supply" else None)
                note(f"{source} lost until {until:.3f} s")
            case "chamber-alarm":
                number = int(fault.number("number"))
                twin.set_alarm(number, fault.word("state"), limit_degC=fault.number("limit_degC"))
                note(f"alarm {number} {fault.options['state']} until {until:.3f} s")
                return lambda: twin.set_alarm(number, "none", "off")
            case "door-open":
                chamber = bench.plant.chamber(fault.on)
                chamber.open_door(now, fault.number("time_constant_s"))
                note(f"door open until {until:.3f} s")
                return lambda: chamber.close_door(bench.world.now())
            case "open-circuit" if hasattr(twin, "sensor_broken"):
                twin.sensor_broken = True
                note(f"sensor broken until {until:.3f} s")
                return lambda: setattr(twin, "sensor_broken", False)
            case _:
                lasts = until if fault.for_s or fault.kind in ("frozen-reading", "open-circuit") else inf
                return tamper_with(twin.inputs, fault, lasts, note, bench.plant.truth.seed)
        return None

    def _power_cycle(self, fault: Fault, twin: Any, until: float, note: Callable[[str], None]) -> Callable[[], None]:
        wire = self._bench.wire(fault.on)
        twin.power_cycle()
        wire.deafen(until)
        note(f"off until {until:.3f} s")

        def on() -> None:
            twin.power_cycle()
            note("on again")

        return on
