"""Certificates, random ones and those of random simulated runs: `python -m proving certificates runs --schema dcc.xsd`.

Each seed of `runs` is a stand with one to three sensors, its register, a run, and its certificate; half of the stands
are of the kind "general", a quarter each of attitude and pressure. The XML is held to PTB's
schema and Schematron and read back; every number of the page is looked for in the run file, the settings, and what a
budget and a trace of the run file have. Coefficients of general and attitude stands are fitted a
second time, by numpy alone, from the observations.
"""

from __future__ import annotations

import datetime
import json
import random
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from proving.certificates import checks as checks_of
from proving.certificates.checks import Check, not_read_back
from proving.certificates.labs import AttitudeStand, LabStand, PressureStand
from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from rig.engine.session import Signals
from rig.errors import UsageError
from rig.procedures.evaluate.reversibility import SERIES
from rig.run_file.read.reader import RunReader
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table
from rig.verbs.budget.evaluation import DOMINATED
from rig.verbs.budget.result import budget
from rig.verbs.certificate import standing_sentences as words
from rig.verbs.certificate.document import Document
from rig.verbs.certificate.issue import Issue, issue
from rig.verbs.certificate.parts_in_numbers import SMALL
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Made, Refused, make
from rig.verbs.certificate.typeset import plain
from rig.verbs.data.result import open as open_data

ISSUED = datetime.date(2026, 11, 24)
_TOKEN = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
DUE = (
    "number = '{number}'\ndate = 2020-02-03\ndue = 2040-01-01\nlaboratory = 'An institute'\n"
    "holds_at = {{ temperature_degC = [10, 40], humidity_pct = [5, 95] }}\n"
)


class Stand:
    """The files of a random stand, by a seed, and a certificate of its run."""

    def __init__(self, seed: int, folder: Path) -> None:
        self._of, self.folder = random.Random(seed), folder
        of = self._of
        self.names = [f"cell_{letter}" for letter in "abc"[: of.randint(1, 3)]]
        self.top = of.choice((1.0, 5.0, 20.0, 100.0))
        self.degree = of.choice((1, 1, 2))
        count = of.randint(3 + self.degree, 6)
        self.levels = [round(self.top * n / (count - 1), 3) for n in range(count)]
        self.points = sorted(round(of.uniform(0.1, 0.95) * self.top, 2) for _ in range(of.randint(1, 3)))
        terms = {name: self._coefficients() for name in self.names}
        self.at = [{"force_kN": point} for point in self.points]
        self.limits = (-0.4, 0.4)
        self._write("procedure", self._procedure())
        self._write("bench", self._bench())
        self._write("world", self._world(seed, terms))
        self._write("equipment", self._register())
        self._write("certificate", self._settings())

    def _coefficients(self) -> list[float]:
        of = self._of
        return [of.uniform(-0.5, 0.5), of.uniform(0.5, 5) / self.top, of.uniform(-0.1, 0.1) / self.top**2]

    def _write(self, name: str, text: str) -> None:
        (self.folder / f"{name}.toml").write_text(text)

    def _procedure(self) -> str:
        of = self._of
        formula = " + ".join(["1", "force_kN", "force_kN^2"][: self.degree + 1])
        return (
            f"kind = 'general'\nname = 'random stand'\nseed = {of.randrange(99)}\nreplications = {of.randint(2, 4)}\n"
            f"[factors.force_kN]\nlevels = {self.levels}\norder = '{of.choice(('up-down', 'as written', 'random'))}'\n"
            f"[settle]\ndwell_s = 5\n[measure]\nreadings = {of.randint(2, 5)}\n[model]\nformula = '{formula}'\n"
        )

    def _bench(self) -> str:
        sensors = "".join(f"[sensors.{name}]\nreader = 'dvm_{name}'\n" for name in self.names)
        meters = "".join(
            f"[instruments.dvm_{name}]\ndriver = 'keysight-34401a'\naddress = '/dev/rig/{name}'\nnplc = 1\n"
            f"asset = 'DVM-{name}'\n"
            for name in self.names
        )
        person = "[instruments.operator]\ndriver = 'person'\nasset = 'W-1'\n"
        factors = f"[factors]\nforce_kN = 'operator'\n[limits]\nforce_kN = [0, {2 * self.top}]\n"
        return f"name = 'random stand'\nequipment = 'equipment.toml'\n{meters}{person}{sensors}{factors}"

    def _world(self, seed: int, terms: dict[str, list[float]]) -> str:
        noise = 10 ** self._of.uniform(-5.5, -3.5)
        sensors = "".join(
            f"[sensors.{name}]\nformula = '{b:.9f} + {s:.9f}*force_kN + {c if self.degree > 1 else 0.0:.9f}*force_kN^2'"
            f"\nnoise = {noise:.3e}\n"
            for name, (b, s, c) in terms.items()
        )
        return f"seed = {seed + 1}\n{sensors}[person]\nsets_s = 20\n"

    def _says(self, asset: str, quantity: str, unit: str) -> str:
        of = self._of
        behaves, units = of.choice((("gain", ("ppm", "%")), ("offset", (unit,)), ("setting", (unit,))))
        size = f"{10 ** of.uniform(-5, -3):.2e}" if behaves != "gain" else f"{of.uniform(0.001, 0.02):.4f}"
        how = of.choice(
            (
                f"expanded = {size}\nk = 2\nprobability = 0.95",
                f"standard = {size}\ndf = {of.randint(5, 60)}",
                f"half_width = {size}",
            )
        )
        more = of.choice(("", f"drift = {size}\n", f"resolution = {size}\n"))
        return (
            f"[[equipment.{asset}.says]]\nquantity = '{quantity}'\nbehaves = '{behaves}'\nunit = '{of.choice(units)}'\n"
            f"{how}\n{more}"
        )

    def _register(self) -> str:
        parts = ["name = 'random stand'\n[laboratory]\nname = 'A laboratory'\naddress = '1 Road'\n"]
        meters = [(f"DVM-{name}", "V", "V") for name in self.names]
        for n, (asset, quantity, unit) in enumerate([("W-1", "force_kN", "kN"), *meters]):
            parts.append(
                f"[equipment.{asset}]\nmaker = 'M'\nmodel = 'T {n}'\nserial = 'S{self._of.randrange(10**5)}'\n"
            )
            parts.append(f"[equipment.{asset}.certificate]\n" + DUE.format(number=f"C-{self._of.randrange(10**5)}"))
            parts += [self._says(asset, quantity, unit) for _ in range(self._of.randint(1, 2))]
        for name in self.names:
            serial = self._of.randrange(10**6)
            parts.append(
                f"[sensors.{name}]\nmaker = 'Cells'\nmodel = 'C'\nserial = '{serial}'\ncustomer = 'Somebody'\n"
            )
            parts.append("customer_address = '2 Road'\ncondition = 'clean'\n")
        return "".join(parts)

    def _settings(self) -> str:
        of, at = self._of, ", ".join(f"{{ force_kN = {point} }}" for point in self.points)
        rule = of.choice(("simple", "guard-band", "probability", "shared-risk"))
        tolerance = "[[tolerance]]\nresult = 'coefficient 1'\nunit = 'V'\nlower = -0.4\nupper = 0.4\n"
        return (
            "number = 'R-{year}-{next:04d}'\ncountry = 'GB'\nitem = 'Load cell'\ncalibrated_by = 'A. B.'\n"
            f"approved_by = 'C. D.'\nat = [{at}]\nannex = '{of.choice(('all', 'largest'))}'\n"
            f"[method]\nname = 'comparison with weights'\n[decision]\nrule = '{rule}'\n"
            + (tolerance if of.random() < 0.5 else "")
        )

    def again(self, run: Path, printed: Mapping[str, Mapping[str, float]]) -> Iterator[tuple[str, str, float]]:
        """Coefficients by least squares; as many as are printed, for a wrong number of them is one, too."""
        table = run_table(run)
        columns = np.vander(table.columns["force_kN"], self.degree + 1, increasing=True)
        for output, sensor in table.outputs.items():
            labels = [label for label in printed.get(sensor, {}) if label.startswith("coefficient ")]
            found = np.linalg.lstsq(columns, table.columns[output], rcond=None)[0]
            yield sensor, "count of coefficients", float(len(labels) - len(found))
            yield from ((sensor, label, value) for label, value in zip(labels, found.tolist(), strict=False))


AnyStand = Stand | LabStand
KINDS: Mapping[str, type[Stand] | type[LabStand]] = {
    "general": Stand,
    "attitude": AttitudeStand,
    "pressure": PressureStand,
}


def stand_of(kind: str, seed: int, folder: Path) -> AnyStand:
    """The stand of a seed; of the kinds in turn for "mixed"."""
    turns = ("general", "attitude", "general", "pressure")
    return KINDS[turns[seed % len(turns)] if kind == "mixed" else kind](seed, folder)


def run_of(stand: AnyStand) -> Path:
    """The finished run file of a stand."""
    folder = stand.folder
    plan = load_plan(folder / "procedure.toml", folder / "bench.toml", dry=True, world=folder / "world.toml")
    paths: list[Path] = []
    start_run(plan, folder, signals=Signals(), announce=paths.append, on_progress=lambda _: None)
    return paths[0]


def not_computed_again(run: Path, stand: AnyStand, document: Document) -> Iterator[str]:
    """Printed results that are not those of another computation, to half a unit of their last place."""
    texts = {
        one.sensor: {result.label: result.value for result in one.results} for one in document.tables if one.sensor
    }
    printed = {sensor: {label: float(text) for label, text in by.items()} for sensor, by in texts.items()}
    for sensor, label, value in stand.again(run, printed):
        text = texts[sensor].get(label, "0")
        if abs(float(text) - value) > 0.501 * last_place(text):
            yield f"{sensor}, {label}: {text} is printed, numpy has {value!r}"


def last_place(text: str) -> float:
    """One unit of the last digit of a number."""
    digits, _, power = text.lower().partition("e")
    return float(10.0 ** (int(power or 0) - len(digits.partition(".")[2])))


def page_text(page: str) -> str:
    """Text of a page, with plain numbers."""
    body = page.partition("<body")[2]
    text = re.sub(r"<(style|script|svg)\b.*?</\1>", " ", body, flags=re.DOTALL)
    text = unescape(re.sub("<[^>]*>", " ", text)).replace("\u202f", "").replace("−", "-")
    return re.sub(" × 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda power: plain(f"1{power[0]}")[1:], text)


def numbers_of(told: Any) -> Iterator[float]:
    """All finite numbers in JSON values."""
    if isinstance(told, dict):
        told = list(told.values())
    if isinstance(told, list | tuple):
        for one in told:
            yield from numbers_of(one)
    elif isinstance(told, int | float) and np.isfinite(told):
        yield float(told)


def conforming(result: dict[str, Any], limits: tuple[float, float]) -> float:
    """Probability in percent that a result is inside the limits."""
    df = min(result["df"], 1e9) if result["df"] else 1e9
    ends = [(end - result["value"]) / result["standard_uncertainty"] for end in limits]
    low, high = special.stdtr(df, ends)
    return float(100.0 * (high - low))


def sources(run: Path, stand: AnyStand, made: Made) -> tuple[list[float], str]:
    """Numbers that follow from the run file alone, and texts of the run file, of the settings, and fixed ones."""
    settings = made.settings
    with RunReader.open(run) as reader:
        kept = [*reader.documents().values(), reader.about().run_id, str(reader.head()[0]), reader.head()[1].hex()]
    table = run_table(run)
    kept.append(json.dumps(dict(table.provenance), default=str))
    numbers: list[float] = [float(len(table)), 100.0 * settings.probability]
    for shapes in (False, True):
        told = budget(run, at=stand.at, probability=settings.probability, same_meter=settings.same_meter, shapes=shapes)
        kept += told.to_json()["notes"]  # as `rig budget` prints them
        for result in told.to_json()["results"]:
            numbers += numbers_of(result)
            numbers += [100.0 * line["share"] for line in result["contributions"]]
            shares = [abs(line["share"]) for line in result["contributions"]]
            numbers.append(float(sum(share < SMALL for share in shares)))  # those that are not listed
            numbers += [
                conforming(result, stand.limits),
                99.9,
                0.1,
            ]  # a probability beyond these is printed as one of them
    for name, values in table.columns.items():
        if name.endswith("_degC"):  # conditions
            numbers += [float(values.min()), float(values.mean()), float(values.max())]
    traced = open_data(run).trace()
    numbers += [scale * number for number in numbers_of(traced.to_json()["sensors"]) for scale in (1.0, 100.0)]
    kept += [
        f"{one.cause} {one.size} {one.size_95} {one.shared}"
        for outcome in traced.traced.outcomes
        for one in outcome.findings
    ]
    fixed = json.dumps({name: text for name, text in vars(words).items() if name.isupper()}, default=str)
    kept += [settings.decision.words, DOMINATED, SERIES]
    return numbers, " ".join([*kept, (stand.folder / "certificate.toml").read_text(), fixed])


def not_in_run(page: str, numbers: list[float], texts: str, document: Document) -> list[str]:
    """Numbers of a page that are neither in a text nor, rounded, one of the numbers."""
    said = set(_TOKEN.findall(texts))
    said |= {token.lstrip("+-") for token in said}
    number, sorted_numbers = document.number, np.sort(np.abs(numbers))
    counted = {str(n) for n in range(1 + max(len(document.budgets), len(document.equipment), 9))}
    known = {*said, *counted, *_TOKEN.findall(number), *_TOKEN.findall(str(document.dates.issued))}
    known |= {token.lstrip("+-") for token in known}
    found = []
    for one in document.evidence:
        for fingerprint in (one.head, one.run_id):  # broken into lines anywhere
            broken = re.compile(r"\s*".join(map(re.escape, fingerprint)))
            found += [] if broken.search(page) else [f"page: {fingerprint} is not whole"]
            page = broken.sub(" ", page)
    for token in dict.fromkeys(_TOKEN.findall(page)):
        if token in known or token.lstrip("+-") in known:
            continue
        size = abs(float(token))
        near = np.searchsorted(sorted_numbers, [size - last_place(token), size + last_place(token)])
        if near[0] == near[1]:
            found.append(f"page: {token} is not in the run file")
    return found


def violations(kind: str, seed: int, folder: Path, checks: Sequence[Check]) -> list[str]:
    """All that is wrong with the certificate of the run of a seed."""
    stand = stand_of(kind, seed, folder)
    run = run_of(stand)
    made = make(CertificateRequest((run,), ISSUED, settings=folder / "certificate.toml"))
    issued = issue(made, Issue(folder / "out"))
    document, files = issued.document, {path.suffix: path for path in issued.files}
    xml = files[".xml"].read_bytes()
    found = [one for check in checks for one in check(xml)] + not_read_back(document, xml)
    numbers, texts = sources(run, stand, made)
    page = files[".html"].read_text()
    found += not_in_run(page_text(page), numbers, texts, document)
    found += not_computed_again(run, stand, document)
    return found


def documents(schema: str = "", paper: int = 20) -> Study:
    """Random certificates, with any characters; each `--paper`-th is printed, too."""
    return _study({"random certificates": partial(_document, schema=schema, paper=paper)})


def _document(seed: int, schema: str, paper: int) -> Result:
    found = checks_of.violations(seed, checks_of.checks(schema), paper=bool(paper) and seed % paper == 0)
    return {"seed": seed, "wrong": found[:5], "refused": ""}


def runs(kind: str = "mixed", schema: str = "") -> Study:
    """Certificates of random simulated runs, of one kind or mixed."""
    if kind not in ("mixed", *KINDS):
        raise UsageError(f"--kind {kind}: there are mixed, {', '.join(KINDS)}")
    return _study({f"certificates of {kind} runs": partial(_run, kind=kind, schema=schema)})


def _run(seed: int, kind: str, schema: str) -> Result:
    with tempfile.TemporaryDirectory() as folder:
        try:
            found = violations(kind, seed, Path(folder), checks_of.checks(schema))
        except Refused as why:
            return {"seed": seed, "wrong": [], "refused": why.reasons[0]}
    return {"seed": seed, "wrong": found[:5], "refused": ""}


def _study(cases: Mapping[str, Callable[[int], Result]]) -> Study:
    return Study(cases, _told, fails=lambda rows: any(row["with something wrong"] for row in rows.values()))


def _told(results: Results) -> Figures:
    said = {f"seed {one['seed']}": one["wrong"] for one in results if one["wrong"]}
    said |= {f"seed {one['seed']}": f"refused: {one['refused']}" for one in results if one["refused"]}
    wrong, refused = (sum(bool(one[name]) for one in results) for name in ("wrong", "refused"))
    return {"of": len(results), "refused": refused, "with something wrong": wrong, "which": said}


PARTS = {"documents": Part(documents, 1000), "runs": Part(runs, 150)}
