"""A declared instrument that measures: one channel or several, asked one by one or all with one answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rig.contracts.declared.exchanges import Ask
from rig.contracts.declared.roles import Channel, Reader
from rig.drivers.declared.base import Declared
from rig.drivers.declared.talk import Answer
from rig.drivers.errors import BadReply, ChannelsFailed, DriverError, InstrumentError, LimitError, NotReady
from rig.drivers.roles import OVERLOAD, is_overload
from rig.drivers.scpi_learned import PrintedForm

INPUT = "input"
_LATE_S = 2.0  # beyond the declared duration; chosen
_CHARACTERS_PER_READING = 20  # chosen: a number of any maker with its comma
_MARKS = 31  # bits of the service request mask without an effect on these lines: see `rig.drivers.scpi`


class DeclaredReader(Declared):
    """It satisfies `rig.drivers.roles.Reader`, `WithUnits`, `SelfChecking` and `Learning`."""

    def _begin(self) -> None:
        super()._begin()
        assert self.table.reader is not None
        self._reader: Reader = self.table.reader
        every = self._reader.channels or {INPUT: Channel()}
        chosen = None if self.table.scan is not None else getattr(self._options, "channels", None)
        self._channels = {name: every[name] for name in chosen or every}
        self._count = self._mark = 0
        self._due = 0.0
        self._forms = {name: PrintedForm() for name in self._channels}
        fetch = self._reader.fetch
        fixed = fetch is not None and all("{values:+." in form and "e2}" in form for form in fetch.forms)
        # no digit is lost on other wires, and a form that fixes every character has nothing to be learned
        self._learns = self.table.lines and not fixed
        asked = self._reader.reading.ask if self._reader.reading is not None else None
        own = any(one.reading is not None for one in self._channels.values())
        # whether each channel has a question of its own
        self._one_by_one = bool(self._reader.select) or own or "{channel}" in (asked or "")

    def _ask_parameters(self) -> None:
        found: dict[str, str | float] = dict(self.table.parameters)
        for name, ask in self.table.asked.items():
            found[name] = self._talk.number(ask)
            allowed = self.table.choices.get(name, (found[name],))
            if found[name] not in allowed:
                raise self._talk.bad(ask, f"{found[name]:g}", f"{name}: {' or '.join(f'{one:g}' for one in allowed)}")
        self._reader = self._reader.model_copy(update=self.table.computed(found))

    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""
        return tuple(self._channels)

    def units(self) -> Mapping[str, str]:
        """Unit of each channel's readings, by channel, as at the end of column names ("mV", "kN", "ohm")."""
        return {name: one.unit or self._reader.unit or "" for name, one in self._channels.items()}

    def learned(self) -> Mapping[str, str | int]:
        """Its knowledge: the form of its readings."""
        found = {f"{name} {key}": one for name, form in self._forms.items() for key, one in form.learned.items()}
        return {key.removeprefix(f"{INPUT} "): one for key, one in found.items()}

    def recall(self, learned: Mapping[str, str | int]) -> None:
        """Take the knowledge of an earlier session of the run."""
        for name, form in self._forms.items():
            begin = "" if name == INPUT else f"{name} "
            form.recall({key.removeprefix(begin): one for key, one in learned.items() if key.startswith(begin)})

    def _sweep_s(self) -> float:
        """Duration of one sweep over all channels, seconds."""
        each = self._reader.reading_s * (1 + self._reader.discard) + self._reader.settle_s
        return each * (len(self._channels) if self._one_by_one or self.table.scan is not None else 1)

    def start(self, count: int) -> float:
        """Trigger `count` sweeps over all channels; returns the seconds they are expected to take.

        Raises:
            LimitError: fewer than one reading, or more than its memory holds.
            InstrumentError: it refuses.
        """
        reader = self._reader
        most, what = (reader.most // len(self._channels), "sweeps") if self.table.scan else (reader.most, "readings")
        if not 1 <= count <= most:
            raise LimitError(f"{self._where} can take 1 to {most} {what} at once, not {count}")
        if reader.start:
            self._number()
            for command in reader.start:
                self._talk.tell(command, {"count": float(count), "mark": float(self._mark)}, checked=False)
        expected = count * self._sweep_s() if reader.start else 0.0  # otherwise fetching takes the time
        self._count = count
        self._due = self._clock.now() + expected
        return expected

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Collect the readings of the last `start`, by channel, waiting for them if necessary.

        Raises:
            NotReady: nothing was started, or no reading became stable.
            ChannelsFailed: some channels have no reading; it has those of the others.
            NoReply: the readings did not come; the measurement has been given up.
            InstrumentError: it reports an error; its readings are not used.
            BadReply: the wrong number of readings, or readings of another measurement.
        """
        if not self._count:
            raise NotReady(f"{self._where}: there is nothing to fetch; start a measurement first")
        count, self._count = self._count, 0
        failed: dict[str, DriverError] = {}
        try:
            if self._reader.start:
                found = self._block(count)
            else:
                found = {name: [] for name in self._channels}
                for _ in range(count):
                    for name, reading in self._sweep(failed).items():
                        found[name].append(reading)
        except DriverError:
            # errors are often the reason; one that has to be cleared does not answer before
            steps = (self._talk.raise_errors, self._give_up)
            first, last = reversed(steps) if self.table.wire.clear else steps
            try:
                first()
            finally:
                last()
            raise
        if failed:
            self._talk.forget_errors()
        elif self.table.errors.each:
            self._talk.raise_errors()
        read = {name: self._of_one_form(name, readings) for name, readings in found.items() if name not in failed}
        if failed:
            raise ChannelsFailed(self._where, {name: str(error) for name, error in failed.items()}, read)
        return read

    def _of_one_form(self, name: str, readings: Sequence[tuple[str, float]]) -> list[float]:
        """Values of readings. Raises `BadReply` if one is printed in another form than all before."""
        odd = self._forms[name].strange([text for text, value in readings if text and not is_overload(value)])
        if odd:
            raise BadReply(
                f"{self._where} printed a reading as {odd!r}, and all before in another form: a character may have "
                f"been lost or doubled on its way; it is asked again"
            )
        return [value for _, value in readings]

    def _number(self) -> None:
        """Give the next readings a number."""
        self._mark = self._mark % _MARKS + 1
        for command in self._reader.number:
            self._talk.tell(command, {"mark": float(self._mark)}, checked=False)

    def _sweep(self, failed: dict[str, DriverError]) -> dict[str, tuple[str, float]]:
        """One reading of every channel that has not `failed`; one that fails is put there, unless no other is left.

        An answer that makes no sense is one of the wire, and fails the sweep.
        """
        if not self._one_by_one:
            reading = self._reader.reading
            assert reading is not None
            self._confirmed({})
            taken = self._taken(reading, {})

            def read(name: str, one: Channel) -> tuple[str, float]:
                return self._read(reading, one, taken)

        else:
            self._talk.sweep()

            def read(name: str, one: Channel) -> tuple[str, float]:
                return self._of_channel(name, one)[0]

        found = {}
        for name, one in self._channels.items():
            if name in failed:
                continue
            try:
                found[name] = read(name, one)
            except (InstrumentError, NotReady) as error:
                failed[name] = error
                if len(failed) == len(self._channels):
                    raise
            except DriverError:
                if failed:  # what failed first may be why
                    raise next(iter(failed.values())) from None
                raise
        return found

    def _of_channel(self, name: str, one: Channel, count: int = 1) -> list[tuple[str, float]]:
        """Readings of one channel after choosing it."""
        ask = one.reading or self._reader.reading
        assert ask is not None
        reader, holes = self._reader, {"channel": one.is_ or name}
        for command in reader.select:
            self._talk.tell(command, holes)
        if reader.settle_s:
            self._clock.sleep(reader.settle_s)
        self._confirmed(holes)
        for _ in range(reader.discard):
            self._taken(ask, holes)
        found = [self._read(ask, one, self._taken(ask, holes))]
        for _ in range(1, count):
            self._confirmed(holes)
            found.append(self._read(ask, one, self._taken(ask, holes)))
        return found

    def _confirmed(self, holes: Mapping[str, float | str]) -> None:
        """Ask what is to be asked before a reading: after it, an answer to an earlier question for one is none."""
        if self._reader.confirm is not None:
            self._talk.ask(self._reader.confirm, holes)

    def _taken(self, ask: Ask, holes: Mapping[str, float | str]) -> Answer:
        """An answer that is stable, as the file demands. Raises `NotReady` if none becomes so."""
        reader, began = self._reader, self._clock.now()
        timeout_s = (reader.reading_s * 1.25 + self.table.wire.timeout_s) if reader.reading_s else None
        while True:
            self._number()
            found = self._talk.once(ask, {**holes, "mark": float(self._mark)}, timeout_s, repeat=False)
            unstable = found.meaning == "unstable" and reader.unstable == "wait"
            if not unstable and found.meaning != "busy":
                break
            if self._clock.now() >= began + reader.patience_s:
                raise NotReady(
                    f"{self._where} had no stable reading for {reader.patience_s:g} s, last {found.printed!r}"
                )
            self._clock.sleep(max(reader.again_s, 0.01))
        if found.meaning == "unstable" and reader.unstable == "refuse":
            raise NotReady(f"{self._where} says that its reading {found.printed!r} is not stable")
        return found

    def _read(self, ask: Ask, channel: Channel, found: Answer) -> tuple[str, float]:
        """The reading of a channel in an answer: as printed, and its value."""
        if channel.field != "value":
            if channel.field not in found.fields:
                raise self._talk.bad(ask, found.printed, f"{channel.field} in it")
            text = found.fields[channel.field]
            if self._talk.meant(ask, text, None) == "overload":
                return "", OVERLOAD
            return self._value(text, self._talk.value_of(ask, channel.field, found))
        if found.meaning == "overload":
            return "", OVERLOAD
        if found.value != found.value:
            raise self._talk.bad(ask, found.printed, "a reading")
        return self._value(found.fields.get(ask.field, ""), found.value)

    def _value(self, printed: str, value: float) -> tuple[str, float]:
        if not self._learns:
            printed = ""
        if abs(value) >= self._reader.overload:
            return printed, OVERLOAD if value > 0 else -OVERLOAD
        return printed, value

    def _due_in(self, count: int) -> float:
        """Wait until all readings are due; returns the longest time that their answer may take then, seconds."""
        self._clock.sleep(self._due - self._clock.now())
        sending_s = self._talk.takes_s(count * len(self._channels) * _CHARACTERS_PER_READING)
        return sending_s + count * self._sweep_s() / 4 + _LATE_S

    def _block(self, count: int) -> dict[str, list[tuple[str, float]]]:
        """All readings with one answer, when they are due."""
        fetch = self._reader.fetch
        assert fetch is not None
        wanted = count * len(self._channels)
        seconds = self._due_in(count) + self.table.wire.timeout_s
        found = self._talk.once(fetch, {"mark": float(self._mark), "count": float(count)}, seconds, repeat=False)
        words = found.fields["values"].split(",") if "values" in found.fields else [found.fields.get("value", "")]
        if len(words) != wanted:
            raise self._talk.bad(fetch, found.printed, f"{wanted} numbers")
        values = [self._value(word.strip(), fetch.quantity(float(word))) for word in words]
        return {name: values[n :: len(self._channels)] for n, name in enumerate(self._channels)}

    def make_safe(self) -> None:
        """A running measurement is given up; nothing else can do harm."""
        super().make_safe()
        self._give_up()

    def _give_up(self) -> None:
        self._count = 0
        self._talk.clear()
        for command in self._reader.abort:
            self._talk.tell(command, checked=False)
        if self._reader.abort:
            self._talk.forget_errors()


class ScanningReader(DeclaredReader):
    """One that reads its channels one after another (`rig.drivers.roles.OneAfterAnother`)."""

    def sweep_s(self) -> float:
        """Duration of one sweep over all channels, seconds."""
        return self._sweep_s()


class OneByOneReader(ScanningReader):
    """One whose channels are chosen one after another."""

    def twice_each(self, rounds: int, most: int) -> list[tuple[float, float]]:
        """Two readings of each channel whenever it has been chosen, for so many channels at most, one after another."""
        found = []
        for _ in range(rounds):
            for name, one in list(self._channels.items())[:most]:
                first, second = self._of_channel(name, one, 2)
                found.append((first[1], second[1]))
        return found
