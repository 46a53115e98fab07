"""The kind of a table, and options of kinds, from the command line or from Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from rig.by_kind import known as known_kind
from rig.errors import UsageError
from rig.procedures.evaluate.results import Options, Source
from rig.procedures.kind import Kind
from rig.procedures.kinds import kinds

Choose = Callable[[Kind], type[Options]]
"""The options that a kind declares for a command."""


def chosen(source: Source, given: Mapping[str, Any], choose: Choose) -> tuple[Kind, Any]:
    """The kind of a table, or the one named by options, and its options.

    Raises:
        UsageError: no kind matches the table, or its kind does not have an option.
    """
    known = kinds()
    own = known.get(source.table.kind) if source.is_run else None
    for name in given:
        owners = [one for one in known.values() if name in choose(one).model_fields]
        if own not in owners:
            _check_asked(name, given, owners)
    kind = next((one for one in known.values() if one.asked_by & given.keys()), None) or known_kind(source.table)
    return kind, options_of(kind, given, choose, f"{source.name} is taken for {kind.title}")


def _check_asked(name: str, given: Mapping[str, Any], owners: Sequence[Kind]) -> None:
    """Refuse an option of kinds that must be requested explicitly, if none was."""
    if owners and all(one.asked_by and not one.asked_by & given.keys() for one in owners):
        raise UsageError(f"--{name.replace('_', '-')}: {'; '.join(one.described for one in owners)}")


def options_of(kind: Kind, given: Mapping[str, Any], choose: Choose, because: str) -> Any:
    """The options of a kind.

    Raises:
        UsageError: the kind does not have an option; the message ends with `because`.
    """
    known = kinds()
    for name in given:
        if name not in choose(kind).model_fields:
            owners = [one for one in known.values() if name in choose(one).model_fields]
            if not owners:
                has = ", ".join(choose(kind).model_fields) or "none of its own"
                raise UsageError(f"there is no option {name}; {because}, whose options are: {has}")
            what = " and ".join(one.title for one in owners)
            raise UsageError(f"--{name.replace('_', '-')} is for {what}; {because}")
    try:
        return choose(kind)(**given)
    except ValidationError as error:
        first = error.errors()[0]
        raise UsageError(f"--{str(first['loc'][0]).replace('_', '-')}: {first['msg']}") from error
