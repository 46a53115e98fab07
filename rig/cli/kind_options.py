"""Options that kinds of calibration declare, as options of the command line."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeVar

import typer
from pydantic.fields import FieldInfo

from rig.options_of_kinds import Choose
from rig.procedures.kind import Kind
from rig.procedures.kinds import kinds

Command = TypeVar("Command", bound=Callable[..., Any])


def with_options_of_kinds(
    choose: Choose, told: Callable[[Kind], str] = lambda kind: ""
) -> Callable[[Command], Command]:
    """A command whose last parameter, `given`, takes the given options of kinds, by name.

    Each option is listed under the heading of its kind; an option of several kinds is one option.

    Args:
        choose: the options that a kind declares for the command.
        told: additional help text of a kind; "" for none.
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
    alike: dict[str, list[str]] = {}  # kinds by what they say of it, so that nothing is said twice
    for kind, one in owners:
        alike.setdefault(one.description or "", []).append(kind.title)
    words = [said if alone else f"{', '.join(titles)}: {said}" for said, titles in alike.items()]
    extra = field.json_schema_extra
    shown: Any = extra.get("default", False) if isinstance(extra, Mapping) else False
    heading = owners[0][0].title if alone else "several kinds"
    option = typer.Option(flags, help="; ".join(words), show_default=shown, rich_help_panel=heading.capitalize())
    annotation = Annotated[field.annotation, option]  # type: ignore[name-defined]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=annotation)
