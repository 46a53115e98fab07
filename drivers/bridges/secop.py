"""A module of a SECoP node, such as those of frappy: `secop:HOST:PORT/MODULE/PARAMETER`.

SECoP is an open protocol of lines with JSON (https://sampleenvironment.github.io/secop-site/, "SECoP specification
V1.0"): `read m:p` is answered by `reply m:p [value, {"t": time}]`, `change m:p value` by `changed ...`, `do m:c` by
`done ...`, anything by `error_...`. A read parameter is asked of the hardware by the node.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from rig.drivers.bridges import Value
from rig.drivers.bridges.objects import Wrong, literal, printed
from rig.drivers.errors import BadReply, InstrumentError, WrongInstrument
from rig.drivers.wires.serial_line import SerialLine

_STATES = ((100, "DISABLED"), (200, "IDLE"), (300, "WARN"), (400, "BUSY"))
"""Names of a module's states, with the code below which they are; from 400 on it is an error."""
_UNASKED = ("update", "event", "log", "error_update")
_MOST_UNASKED = 100


class SecopBridge:
    """A module of a SECoP node; see `rig.drivers.bridges.Bridge`.

    Args:
        line: the line to the node, which its modules share.
        module: the module.
        where: the instrument and its address, for messages.
    """

    measures_when_asked = True

    def __init__(self, line: SerialLine, module: str, where: str) -> None:
        self._line, self._module, self._where = line, module, where
        self._accessibles: Mapping[str, Any] = {}

    def identity(self, timeout_s: float) -> tuple[str, str, str, str]:
        """Maker of the protocol, equipment and module, with the firmware as the node says them."""
        said = self._line.query("*IDN?", timeout_s)
        if "SECoP" not in said.split(","):
            raise WrongInstrument(f"{self._where} should be a SECoP node; it answers {said!r} to '*IDN?'")
        node = self._described(timeout_s)
        return "SECoP", f"{node.get('equipment_id', '')} {self._module}".strip(), "", str(node.get("firmware", ""))

    def _described(self, timeout_s: float) -> Mapping[str, Any]:
        """Properties of the node; those of the module are kept. Raises `WrongInstrument` if it has no such module."""
        found = self._answer("describe", ".", "describing", timeout_s)
        node: Mapping[str, Any] = found if isinstance(found, dict) else {}
        modules = node.get("modules", {})
        if self._module not in modules:
            raise WrongInstrument(f"{self._where}: the node has no module {self._module}; it has {', '.join(modules)}")
        self._accessibles = modules[self._module].get("accessibles", {})
        return node

    def read(self, path: str, timeout_s: float) -> Value:
        """A parameter with its unit, asked of the hardware."""
        if not self._accessibles:
            self._described(timeout_s)
        name, index = _indexed(path)
        self._known(name)
        value, told = self._data(name, self._answer("read", f"{self._module}:{name}", "reply", timeout_s))
        stamp = told.get("t")
        unit = self._unit(name) if index is None else ""
        if name == "status" and index is None:
            value = self._state(value)
        try:
            text, _ = printed(value if index is None else value[index], path)
            return Value(text, unit, float(stamp) if isinstance(stamp, int | float) else None)
        except (Wrong, LookupError, TypeError) as wrong:
            raise BadReply(f"{self._where}: {path} is {value!r} ({wrong})") from None

    def _state(self, value: Any) -> str:
        """The name of a state. Raises `InstrumentError` for that of an error."""
        if not (isinstance(value, list) and len(value) == 2 and isinstance(value[0], int)):
            raise BadReply(f"{self._where}: status is {value!r}; expected a code and a text")
        code, text = value
        found = next((name for below, name in _STATES if code < below), None)
        if found is None:
            raise InstrumentError(f"{self._where}, module {self._module},", code, str(text) or "it is in error")
        return found

    def _unit(self, name: str) -> str:
        unit = str(self._accessibles[name].get("datainfo", {}).get("unit", ""))
        own = str(self._accessibles.get("value", {}).get("datainfo", {}).get("unit", ""))
        return unit.replace("$", own).replace("\u00b0", "deg").replace("\u03bc", "u").replace("\u03a9", "ohm")

    def _known(self, name: str) -> None:
        if name not in self._accessibles:
            raise BadReply(
                f"{self._where}: module {self._module} has no {name!r}; it has {', '.join(self._accessibles)}"
            )

    def write(self, path: str, text: str, timeout_s: float) -> None:
        """Change a parameter. Never repeated."""
        if not self._accessibles:
            self._described(timeout_s)
        self._known(path)
        told = json.dumps(literal(text))
        self._answer("change", f"{self._module}:{path}", "changed", timeout_s, told)

    def call(self, path: str, timeout_s: float) -> None:
        """Carry out a command without argument: `stop()`. Never repeated."""
        if not path.endswith("()"):
            raise BadReply(f"{self._where}: {path} is no command; write {path}(), or {path} = VALUE")
        self._answer("do", f"{self._module}:{path[:-2]}", "done", timeout_s)

    def _data(self, name: str, answer: Any) -> tuple[Any, Mapping[str, Any]]:
        if not (isinstance(answer, list) and len(answer) == 2 and isinstance(answer[1], dict)):
            raise BadReply(f"{self._where}: {name} is {answer!r}; expected a value with its qualifiers")
        return answer[0], answer[1]

    def _answer(self, action: str, what: str, right: str, timeout_s: float, told: str = "") -> Any:
        """The answer of the node. Raises `InstrumentError` if it refuses."""
        question = f"{action} {what} {told}".strip()
        said = self._line.query(question, timeout_s, repeat=action in ("read", "describe"))
        for _ in range(_MOST_UNASKED):
            word, _, rest = said.partition(" ")
            if word not in _UNASKED:
                break
            said = self._line.heard(timeout_s)
        of, _, data = rest.partition(" ")
        try:
            found = json.loads(data) if data else None
        except ValueError:
            raise self._line.bad_reply(question, said[:200], "JSON") from None
        if word == f"error_{action}":
            kind, text = (*found, "", "")[:2] if isinstance(found, list) else ("", said)
            raise InstrumentError(f"{self._where}, after {question!r},", 0, f"{kind}: {text}")
        if word != right or of != what:
            raise self._line.bad_reply(question, said[:200], f"an answer that begins with {f'{right} {what}'!r}")
        return found

    def close(self) -> None:
        """Release the line; idempotent."""
        self._line.close()


def _indexed(path: str) -> tuple[str, int | None]:
    """A parameter and the number of one of its values: `status[0]`."""
    name, bracket, index = path.partition("[")
    return (name, int(index[:-1])) if bracket and index[:-1].isdecimal() else (name, None)
