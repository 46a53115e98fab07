"""Options that kinds of calibration declare, as options of the command line; and which kind a command is about."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, TypeVar

import typer
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from procedures.kind import Kind, kinds
from procedures.results import Options, Source
from rig.closed_loop import known as known_kind
from rig.errors import UsageError

Command = TypeVar("Command", bound=Callable[..., Any])
Choose = Callable[[Kind], type[Options]]
"""The options of a command that a kind declares."""


def with_options_of_kinds(
    choose: Choose, told: Callable[[Kind], str] = lambda kind: ""
) -> Callable[[Command], Command]:
    """A command whose last parameter, `given`, takes the options that kinds declare: by name, those that were given.

    Each stands in the help under the heading of its kind; one that several kinds have is one option.

    Args:
        choose: the options of the command that a kind declares.
        told: what the help says of a kind besides; "" for nothing.

    """

    def decorate(command: Command) -> Command:
        fields: dict[str, list[tuple[Kind, FieldInfo]]] = {}
        for kind in kinds().values():
            for name, field in choose(kind).model_fields.items():
                fields.setdefault(name, []).append((kind, field))

        def wrapper(**values: Any) -> Any:
            own = {name: values.pop(name) for name in fields}
            given = {name: value for name, value in own.items() if value != fields[name][0][1].default}
            return command(**values, given=given)

        signature = inspect.signature(command, eval_str=True)
        kept = [p for p in signature.parameters.values() if p.name != "given"]
        added = [_parameter(name, owners) for name, owners in fields.items()]
        wrapper.__signature__ = signature.replace(parameters=[*kept, *added])  # type: ignore[attr-defined]
        wrapper.__annotations__ = {p.name: p.annotation for p in (*kept, *added)}
        wrapper.__name__ = command.__name__
        words = [f"{kind.title.capitalize()}: {text}" for kind in kinds().values() if (text := told(kind))]
        wrapper.__doc__ = "\n\n".join([inspect.cleandoc(command.__doc__ or ""), *words])
        return wrapper  # type: ignore[return-value]

    return decorate


def _tristate(field: FieldInfo) -> bool:
    return field.default is None and bool in getattr(field.annotation, "__args__", ())


def _parameter(name: str, owners: list[tuple[Kind, FieldInfo]]) -> inspect.Parameter:
    field = owners[0][1]
    flag = f"--{name.replace('_', '-')}"
    flags = f"{flag}/--no-{flag[2:]}" if _tristate(field) else flag
    alone = len(owners) == 1
    words = [one.description or "" if alone else f"{kind.title}: {one.description}" for kind, one in owners]
    extra = field.json_schema_extra
    shown: Any = extra.get("default", False) if isinstance(extra, Mapping) else False
    heading = owners[0][0].title if alone else "several kinds"
    option = typer.Option(flags, help="; ".join(words), show_default=shown, rich_help_panel=heading.capitalize())
    annotation = Annotated[field.annotation, option]  # type: ignore[name-defined]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=annotation)


def chosen(source: Source, given: Mapping[str, Any], choose: Choose) -> tuple[Kind, Any]:
    """The kind that a table is of, or that options ask for, and its options.

    Raises:
        UsageError: no kind knows the table, or an option was given that its kind does not have.

    """
    known = kinds()
    for name in given:
        _check_asked(name, given, [one for one in known.values() if name in choose(one).model_fields])
    kind = next((one for one in known.values() if one.asked_by & given.keys()), None) or known_kind(source.table)
    return kind, options_of(kind, given, choose, f"{source.name} is taken for {kind.title}")


def _check_asked(name: str, given: Mapping[str, Any], owners: Sequence[Kind]) -> None:
    """Refuse an option of kinds that have to be asked for, where none of them was."""
    if owners and all(one.asked_by and not one.asked_by & given.keys() for one in owners):
        raise UsageError(f"--{name.replace('_', '-')}: {'; '.join(one.described for one in owners)}")


def options_of(kind: Kind, given: Mapping[str, Any], choose: Choose, because: str) -> Any:
    """The options of a kind.

    Raises:
        UsageError: one was given that it does not have; the message ends with `because`.

    """
    known = kinds()
    for name in given:
        if name not in choose(kind).model_fields:
            owners = [one for one in known.values() if name in choose(one).model_fields]
            what = " and ".join(one.title for one in owners)
            raise UsageError(f"--{name.replace('_', '-')} is for {what}; {because}")
    try:
        return choose(kind)(**given)
    except ValidationError as error:
        first = error.errors()[0]
        raise UsageError(f"--{str(first['loc'][0]).replace('_', '-')}: {first['msg']}") from error
