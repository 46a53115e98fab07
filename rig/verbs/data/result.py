"""`rig.open`: a run file or a CSV table, to fit and to trace."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from math import isfinite, isnan
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from rig.effects import laboratory_effects
from rig.errors import UsageError
from rig.files.atomic import write_whole
from rig.options_of_kinds import chosen
from rig.procedures.errors import DataError
from rig.procedures.present.shell import shell_word
from rig.procedures.present.words import units
from rig.procedures.tables.unused import known_unit_of, sentences
from rig.procedures.tables.within import KEY as READINGS
from rig.tables import FileForm, FileSource, is_run
from rig.tables.of_others.file_form import NOTHING
from rig.verbs.data.registered import REPEATABILITY, Uncertainty, registered
from rig.verbs.frames import Frame, of_rows
from rig.verbs.infer import calibration_in
from rig.verbs.infer.content_hash import with_hashes
from rig.verbs.infer.result import Inferred, check_readings, infer_from
from rig.verbs.observations import Observations
from rig.verbs.result import Reported

if TYPE_CHECKING:
    from rig.fitter.json_values import JsonValue
    from rig.procedures.evaluate.results import Fitted, Page, Traced
    from rig.procedures.kind import Kind
    from rig.procedures.present.blocks import Block
    from rig.procedures.tables.within import Within
    from rig.verbs.infer.result import Readings

_ESTIMATES = ("sensor", "of", "name", "unit"), ("estimate", "stderr", "df")
_EFFECTS = (
    ("sensor", "effect", "stratum", "term", "unit", "doubtful"),
    ("coefficient", "stderr", "share", "p_adjusted"),
)


class Evaluated(Reported):
    """A table that was fitted or traced.

    Attributes:
        kind: of calibration.
        source: the file.
        understood: how a table of others was read; {} for our own.

    """

    def __init__(
        self, evaluated: Fitted | Traced, kind: Kind, source: str, understood: Mapping[str, Any] | None = None
    ) -> None:
        self._evaluated = evaluated
        self.kind = kind
        self.source = source
        self.understood = dict(understood or {})

    @cached_property
    def _told(self) -> dict[str, Any]:
        told = self._evaluated.to_json()
        if self.understood:
            told = {**told, "data": {**told.get("data", {}), "understood": self.understood}}
        return told

    def blocks(self) -> Iterable[Block]:
        """Lines for people."""
        return self._evaluated.blocks()

    def notes(self) -> Sequence[str]:
        """How the table was read, and unused columns and rows."""
        first = [self.understood["sentence"]] if self.understood else []
        return [*first, *sentences(self._told["unused"])]


def in_short(evaluated: Evaluated) -> Iterable[Block]:
    """Lines of a result for people, on one screen where its kind can."""
    own = evaluated._evaluated
    blocks: Callable[[], Iterable[Block]] = getattr(own, "short", own.blocks)
    return blocks()


def first_endless(told: JsonValue, key: str = "") -> tuple[str, float] | None:
    """Key, with points between its parts, and value of the first number that is not finite; None if all are."""
    if isinstance(told, float):
        return None if isfinite(told) else (key, told)
    parts = told.items() if isinstance(told, dict) else enumerate(told) if isinstance(told, list) else ()
    found = (first_endless(value, f"{key}.{name}".lstrip(".")) for name, value in parts)
    return next((one for one in found if one is not None), None)


class Calibration(Evaluated):
    """A fit of the declared model to every sensor.

    Attributes:
        fitted: as its kind has it.

    Example:
        >>> line = rig.open("cell.csv").fit(response="y_V", formula="1 + x_mm")
        >>> line.to_pandas()["estimate"].round(1).tolist()
        [3.0, 2.0]
    """

    def __init__(
        self,
        fitted: Fitted,
        kind: Kind,
        source: str,
        understood: Mapping[str, Any] | None = None,
        uncertainty: Uncertainty = Uncertainty(),  # noqa: B008 - frozen
        within: Mapping[str, Within] = MappingProxyType({}),
    ) -> None:
        super().__init__(fitted, kind, source, understood)
        self.fitted = fitted
        self._uncertainty, self._within = uncertainty, within

    @cached_property
    def _told(self) -> dict[str, Any]:
        told = super()._told
        outputs = told.get("sensors") or [told.get("response", "")]
        within = {name: one.to_dict() for name, one in self._within.items() if name in outputs}
        return {**told, **({READINGS: within} if within else {}), **self._uncertainty.to_json()}

    def notes(self) -> Sequence[str]:
        """As for every result, and which uncertainties its intervals have."""
        words = self._uncertainty.words
        return [*super().notes(), *([f"standard errors and intervals: {words}"] if words else [])]

    @cached_property
    def _page(self) -> Page:
        page = self.fitted.page()
        if page is None:
            trace = f"rig trace {shell_word(self.source)} --report writes one"
            raise UsageError(f"--report: a fit of {self.kind.title} has none; {trace}")
        return page

    def frame(self) -> Frame:
        """One row per coefficient and parameter. Raises `UsageError` if nothing was estimated."""
        rows = list(_estimates(self._told))
        if not rows:
            raise UsageError(f"this result of {self.source} is not a calibration: it has no table of estimates")
        return of_rows(rows, *_ESTIMATES, {"source": self.source, "kind": self.kind.name})

    @property
    def inside(self) -> bool:
        """Whether it is inside the tolerance that was asked for, if one was.

        Example:
            >>> rig.open("cell.csv").fit(response="y_V", formula="1 + x_mm", tolerance=0.5).inside
            True
        """
        return bool(self._told.get("acceptance", {}).get("inside", True))

    def save(self, path: str | Path) -> None:
        """Write the calibration file of `rig fit --out`.

        Args:
            path: a JSON file; an existing one is replaced whole.

        Raises:
            UsageError: the disk refuses.
            DataError: a number of the fit is too large for a double, or is not a number.

        Example:
            >>> rig.open("cell.csv").fit(response="y_V", formula="1 + x_mm").save("line.json")
        """
        endless = first_endless(self._told)
        if endless is not None:
            key, value = endless
            raise DataError(
                f"{self.source}: {key} is not a number: it could not be computed from these data, and no calibration "
                "file can hold it; correct columns with numbers of extreme size, and report it if there are none"
                if isnan(value)
                else f"{self.source}: {key} is too large for a double, and no calibration file can hold it; "
                "correct the column that is so large, or give it in a larger unit"
            )
        write_whole(Path(path), lambda file: json.dump(with_hashes(self._told), file, indent=2, allow_nan=False))

    def infer(
        self, readings: Readings, *, out: str | Path | None = None, mean_of: int | None = None, **options: Any
    ) -> Inferred:
        """Infer the measured quantities; arguments and errors as for `rig.infer`.

        Example:
            >>> line = rig.open("cell.csv").fit(response="y_V", formula="1 + x_mm")
            >>> line.infer({"y_V": [5.0, 7.0]})["x_mm"].round(1).tolist()
            [1.0, 2.0]
        """
        check_readings(readings, out, [Path(self.source)], options)
        file = calibration_in(json.dumps(with_hashes(self._told)), f"the fit of {self.source}")
        return infer_from(file, readings, out, options, mean_of=mean_of)

    def __repr__(self) -> str:
        return f"<rig.Calibration of {self.source}: {self.kind.title}>"


class Trace(Evaluated):
    """Effects that the declared model lacks.

    Attributes:
        traced: as its kind has it.

    Example:
        >>> rig.open("cell.csv").trace(response="y_V", formula="1 + x_mm")
        <rig.Trace of cell.csv: y_V: explained>
    """

    def __init__(self, traced: Traced, kind: Kind, source: str, understood: Mapping[str, Any] | None = None) -> None:
        super().__init__(traced, kind, source, understood)
        self.traced = traced

    @cached_property
    def _told(self) -> dict[str, Any]:
        return {**super()._told, "uncertainty": REPEATABILITY}

    def notes(self) -> Sequence[str]:
        """As for every result, and which uncertainties its intervals have."""
        return [*super().notes(), f"standard errors and intervals: {REPEATABILITY}"]

    @property
    def verdicts(self) -> Mapping[str, str]:
        """By sensor: "explained", "nothing to add", "partly explained" or "unexplained".

        Example:
            >>> rig.open("cell.csv").trace(response="y_V", formula="1 + x_mm").verdicts
            {'y_V': 'explained'}
        """
        return {name: str(found["verdict"]) for name, found in self._told["sensors"].items()}

    @cached_property
    def _page(self) -> Page:
        return self.traced.page()

    def frame(self) -> Frame:
        """One row per term of every effect and per finding about noise."""
        return of_rows(_effects(self._told), *_EFFECTS, {"source": self.source})

    def __repr__(self) -> str:
        told = "; ".join(f"{name}: {verdict}" for name, verdict in self.verdicts.items())
        return f"<rig.Trace of {self.source}: {told}>"


class Data:
    """A run file or a CSV table, read once at its first use.

    Attributes:
        path: the file.

    Example:
        >>> data = rig.open("cell.csv")
        >>> len(data.table)
        60
        >>> data.fit(response="y_V", formula="1 + x_mm")
        <rig.Calibration of cell.csv: any table>
    """

    def __init__(self, path: str | Path, asked: FileForm = NOTHING) -> None:
        self.path = Path(path)
        self._run = is_run(self.path)
        self._source = FileSource(self.path, asked)

    @cached_property
    def table(self) -> Observations:
        """Its observations; for a run the accepted ones. Raises `UsageError` or `RunFileError`."""
        return Observations(self._source.table if self._run else self._source.read(()))

    def fit(
        self,
        *,
        leave_out: str | int | Iterable[str | int] = (),
        confirmed_by: str | Path | Iterable[str | Path] = (),
        **options: Any,
    ) -> Calibration:
        """Fit the declared model to every sensor.

        Args:
            leave_out: "gross" for the gross errors found, or numbers of rows.
            confirmed_by: a later run file, or several; the calibration gets the causes that they confirmed.
            options: of `rig fit` for this kind of table, with underscores for hyphens.

        Raises:
            UsageError: no kind matches the table, or it does not have an option.
            DataError: columns or values are missing, or the rows do not determine the model.
            RunFileError: the run file is damaged.

        Example:
            >>> rig.open("night.sqlite").fit()
            <rig.Calibration of night.sqlite: ...>
            >>> len(rig.open("cell.csv").fit(response="y_V", formula="1 + x_mm", leave_out=[3, 5]).notes()) > 0
            True
        """
        rows = [leave_out] if isinstance(leave_out, (str, int)) else list(leave_out)
        later = [Path(one) for one in ([confirmed_by] if isinstance(confirmed_by, (str, Path)) else confirmed_by)]
        return fit_source(self._source, options, [str(row) for row in rows], later)

    def trace(self, **options: Any) -> Trace:
        """Find effects missing in the declared model.

        Args:
            options: of `rig trace` for this kind of table, with underscores for hyphens.

        Raises:
            UsageError, DataError, RunFileError: as for `fit`.

        Example:
            >>> rig.open("cell.csv").trace(response="y_V", formula="1 + x_mm").verdicts
            {'y_V': 'explained'}
        """
        return trace_source(self._source, options)

    def _repr_html_(self) -> str:
        return self.table._repr_html_()

    def __str__(self) -> str:
        return str(self.table)

    def __repr__(self) -> str:
        return f"rig.open({str(self.path)!r})"


def open(  # noqa: A001 - rig.open, as one opens a file
    path: str | Path,
    *,
    separator: str | None = None,
    decimal: str | None = None,
    encoding: str | None = None,
    header: int | None = None,
) -> Data:
    """Open a run file or a CSV table, also one that another program wrote.

    Args:
        path: the file.
        separator: between cells, if it is not recognised: "comma", "semicolon", "tab", "pipe", "space".
        decimal: "point" or "comma".
        encoding: of the text, such as "cp1252".
        header: row of the column names; 0 for none.

    Raises:
        UsageError: the file does not exist, or an argument is wrong.

    Example:
        >>> rig.open("night.sqlite").table["x_V"].size
        24
        >>> rig.open("cell.csv").trace(response="y_V", formula="1 + x_mm").verdicts
        {'y_V': 'explained'}
    """
    return Data(path, FileForm.of(separator, decimal, encoding, header))


def fit_source(
    source: FileSource,
    given: Mapping[str, Any],
    leave_out: Sequence[str] = (),
    confirmed_by: Sequence[Path] = (),
    *,
    keep: bool = False,
    equipment: Path | None = None,
    added: Sequence[Path] = (),
) -> Calibration:
    """`rig fit`: arguments and errors as for `Data.fit`; `keep` means that the result is written to a file, `added` are
    files of replications that were added to the run.

    A run with a register of equipment, its own or the given one, is corrected by its certificates, and the calibration
    keeps their influences.
    """
    of = registered(source, equipment, added)
    run, source = source.path, of.source(source)
    kind, options = chosen(source, _asked(given), lambda one: one.fit_options)
    fitted: Fitted
    others = ["--leave-out"] if leave_out else []
    evaluated, without = None, []
    if confirmed_by:
        from rig.procedures.evaluate.points import WITH_EFFECTS  # noqa: PLC0415
        from rig.verbs.confirm import fit_confirmed  # noqa: PLC0415 - which few fits need

        if leave_out:
            raise UsageError("--confirmed-by uses all rows: omit --leave-out")
        if given.get("at"):
            raise UsageError(WITH_EFFECTS)
        fitted = confirmed = fit_confirmed(run, confirmed_by, options, of.table_of)
        evaluated = confirmed.evaluation
        without = confirmed.without
        others += [] if evaluated is not None else ["--confirmed-by"]
    else:
        fitted = kind.fit(source, options, leave_out=leave_out, own=laboratory_effects(), keep=keep)
    uncertainty = of.uncertainty(_asked(given), others, evaluated, without, keep=keep)
    return Calibration(fitted, kind, source.name, source.understood, uncertainty, source.within)


def trace_source(source: FileSource, given: Mapping[str, Any]) -> Trace:
    """`rig trace`: arguments and errors as for `Data.trace`."""
    kind, options = chosen(source, _asked(given), lambda one: one.trace_options)
    traced = kind.trace(source, options, own=laboratory_effects())
    return Trace(traced, kind, source.name, source.understood)


def _asked(given: Mapping[str, Any]) -> dict[str, Any]:
    """The given options: those that are not None."""
    return {name: value for name, value in given.items() if value is not None}


def _estimates(result: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    sensors = result.get("sensors") or {str(result.get("response", "")): result}
    for sensor, found in sensors.items():
        for of in ("coefficients", "parameters"):
            for name, value in (found.get(of) or {}).items():
                if isinstance(value, Mapping) and "estimate" in value:
                    unit = value.get("unit", known_unit_of(name) if of == "parameters" else "")
                    yield {"sensor": sensor, "of": of.removesuffix("s"), "name": name, **value, "unit": unit}


def _effects(result: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for sensor, found in result["sensors"].items():
        for effect in found["effects"]:
            each = zip(effect["terms"], effect["coefficients"], effect["stderr"], units(effect), strict=True)
            for term, coefficient, stderr, unit in each:
                of_term = {"term": term, "coefficient": coefficient, "stderr": stderr, "unit": unit}
                yield {**effect, **of_term, "sensor": sensor}
