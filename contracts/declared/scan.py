"""Channels of a scanner: what is connected to each is in the bench file, and its commands have lists of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Annotated, Any

from pydantic import Field, ValidationInfo

from rig.contracts.declared.exchanges import Check, Strict, Tell, Tells, Texts
from rig.contracts.declared.forms import Form
from rig.contracts.declared.options import filled
from rig.contracts.declared.roles import Channel, Unit

_LISTS = frozenset(("list", "names"))


class Sort(Strict):
    """What a channel may be connected to."""

    unit: Unit | None = Field(None, description="unit of its readings; left out: the reader's")
    fills: dict[str, str | int | float] = Field({}, description="what it fills into the lines of groups")
    own: dict[str, str] = Field(
        {}, description="parameters that single channels may have otherwise, by the key of the bench file for them"
    )
    four_wires: bool = Field(
        False, description="it takes a channel of the lower half of a card, and the one a half above it"
    )


class Group(Strict):
    """Lines for channels of some sorts: once for all those whose lines are alike."""

    sorts: Texts = Field((), description="its sorts; left out: those that fill what no parameter fills into its lines")
    prepare: Tells = Field((), description="commands; {list} is its channels, 101:103,105, {names} 101,102,103,105")
    check: tuple[Check, ...] = Field((), description="settings; a question with {list} has an answer for each channel")

    def holes(self) -> frozenset[str]:
        """Names that are filled into its lines, other than those of lists."""
        lines = [one.tell or "" for one in self.prepare]
        lines += [text for one in self.check for text in (one.ask or "", str(one.is_))]
        return frozenset(name for text in lines for name in Form(text).fields) - _LISTS


class Scan(Strict):
    """Channels that the bench file chooses: `channels = { 101 = "volts" }`."""

    cards: tuple[Annotated[str, Field(pattern=r"^[0-9]+:[0-9]+$")], ...] = Field(description="of each card: `101:120`")
    sorts: dict[str, Sort] = Field(min_length=1, description="what a channel may be connected to, by its word")
    groups: tuple[Group, ...] = Field(description="lines that prepare its channels, in this order")

    def _cards(self) -> list[list[str]]:
        ends = [map(int, card.split(":")) for card in self.cards]
        return [[str(number) for number in range(first, last + 1)] for first, last in ends]

    def first(self, count: int = 1) -> dict[str, str]:
        """Its first channels with its first sort, for whoever tries it without a bench file."""
        return dict.fromkeys(self._cards()[0][:count], next(iter(self.sorts)))

    def own(self) -> Mapping[str, str]:
        """Parameters that single channels may have otherwise, by their key in the bench file."""
        return {option: parameter for sort in self.sorts.values() for option, parameter in sort.own.items()}

    def _of(self, group: Group, parameters: Mapping[str, Any]) -> list[str]:
        needed = group.holes() - parameters.keys()
        return list(group.sorts) or [name for name, one in self.sorts.items() if needed <= one.fills.keys()]

    def wrong(self, parameters: Mapping[str, Any]) -> Iterator[str]:
        """What is wrong with it, by the parameters of its file."""
        for option, parameter in self.own().items():
            if parameter not in parameters or option in parameters:
                yield f"scan.sorts: own.{option} = {parameter!r} has to name a parameter, and be none"
        for n, group in enumerate(self.groups):
            ours = [self.sorts.get(name) for name in self._of(group, parameters)]
            if not ours or any(one is None or group.holes() - {*parameters, *one.fills} for one in ours):
                holes = ", ".join(sorted(group.holes() - parameters.keys()))
                yield f"scan.groups[{n}] has sorts that there are not, or that do not fill in all of its {holes}"

    def checked(self, channels: Mapping[str, str]) -> Mapping[str, str]:
        """Channels of a bench file. Raises `ValueError` for one that it does not have, or that another takes."""
        for name, sort in channels.items():
            card = next((card for card in self._cards() if name in card), None)
            if card is None:
                raise ValueError(f"{name} is no channel; there are {', '.join(self.cards)}")
            half = len(card) // 2
            if self.sorts[sort].four_wires and name not in card[:half]:
                ends = f"{card[0]} to {card[half - 1]}"
                raise ValueError(f"{name}: four wires go to channel {ends}, and to the one {half} above it")
            if self.sorts[sort].four_wires and (other := card[card.index(name) + half]) in channels:
                raise ValueError(f"{other} carries the other two wires of {name} and cannot be a channel")
        return channels

    def able(self, values: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Values of single channels in a bench file. Raises `ValueError` for a channel that has none of its own."""
        able = [sort for sort, one in self.sorts.items() if info.field_name in one.own]
        for name in values:
            if info.data.get("channels", {name: able[0]}).get(name) not in able:
                raise ValueError(f"{name} is not a {' or '.join(able)} channel")
        return values

    def chosen(
        self, options: Mapping[str, Any], parameters: Mapping[str, str | float]
    ) -> tuple[list[Tell], list[Check], dict[str, Channel]]:
        """Commands, settings and channels of one scanner, by its options in the bench file."""
        given, order, rows = options.get("channels") or self.first(), list(self.sorts), []
        for name in sorted(given, key=int):
            sort = self.sorts[given[name]]
            own = {one: options.get(option, {}).get(name, parameters[one]) for option, one in sort.own.items()}
            rows.append((order.index(given[name]), list(own.values()), int(name), {**parameters, **sort.fills, **own}))
        tells: list[Tell] = []
        checks: list[Check] = []
        for group in self.groups:
            alike: dict[str, tuple[list[int], dict[str, Any]]] = {}
            for place, _, number, holes in sorted(rows, key=lambda row: row[:3]):
                if order[place] in self._of(group, parameters):
                    same = repr([holes[hole] for hole in sorted(group.holes())])
                    alike.setdefault(same, ([], holes))[0].append(number)
            for numbers, holes in alike.values():
                found = holes | {"list": joined(sorted(numbers)), "names": ",".join(map(str, sorted(numbers)))}
                tells += [one.model_copy(update={"tell": _filled(one.tell, found)}) for one in group.prepare]
                checks += [_for_each(one, found, len(numbers)) for one in filled(group.check, found)]
        return tells, checks, {str(row[2]): Channel(unit=self.sorts[order[row[0]]].unit) for row in rows}


def _filled(line: str | None, holes: Mapping[str, Any]) -> str:
    return Form(line or "").filled(holes).text


def _for_each(check: Check, holes: Mapping[str, Any], count: int) -> Check:
    """A setting of channels: an answer for each, if it asks for a list."""
    found: dict[str, Any] = {"ask": _filled(check.ask, holes)}
    if "{list}" in (check.ask or ""):
        text = isinstance(check.is_, str)
        found |= {"is_": ",".join([str(check.is_)] * count)} if text else {"answer": check.answer or ("{values}",)}
    return check.model_copy(update=found)


def joined(numbers: list[int]) -> str:
    """Channels in ascending order with neighbours joined.

    Example:
        >>> joined([101, 102, 103, 105])
        '101:103,105'
    """
    groups = groupby(enumerate(numbers), lambda pair: pair[1] - pair[0])
    runs = [[number for _, number in run] for _, run in groups]
    return ",".join(f"{run[0]}:{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)
