"""`[[tolerance]]` in percent of reading, span and full scale, by formulas, and for all points at once."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import pytest
from certificate_lab import ISSUED, settled, stand

from rig.errors import ConfigurationError
from rig.verbs.budget.found import Found, found_in
from rig.verbs.certificate.layout import sections
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Refused, make
from rig.verbs.certificate.runs import read_run
from rig.verbs.certificate.tolerances import ToleranceSettings

AT = {"force_kN": 4.0}


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    return stand(tmp_path_factory.mktemp("stand"))


@pytest.fixture(autouse=True)
def traced_once(monkeypatch):
    """The trace of a run follows from the run alone: made once for all tests."""
    monkeypatch.setitem(read_run.__globals__, "found_in", TRACED)


_FOUND: dict[tuple[Path, tuple[Path, ...]], Found] = {}


def TRACED(of, path, later=(), equipment=None) -> Found:
    """What a trace finds, once for each file."""
    key = (path, tuple(later))
    if key not in _FOUND:
        _FOUND[key] = found_in(of, path, later, equipment)
    return _FOUND[key]


def made(run: Path, folder: Path, tolerance: str):
    return make(
        CertificateRequest((run,), date.fromisoformat(ISSUED), settings=settled(folder, f"[[tolerance]]\n{tolerance}"))
    )


@pytest.mark.parametrize(
    ("more", "lower", "upper"),
    [
        ({"nominal": 2.0, "percent_of_reading": 0.1}, 1.998, 2.002),
        ({"nominal": -2.0, "percent_of_reading": 0.1}, -2.002, -1.998),
        ({"nominal": "0.5 * force_kN", "percent_of_span": 0.1, "span": 20.0}, 1.98, 2.02),
        ({"nominal": 2.0, "percent_of_full_scale": 0.05, "full_scale": 10.0}, 1.995, 2.005),
        ({"nominal": 2.0, "deviation": "0.01 + 0.0005*abs(force_kN)"}, 1.988, 2.012),
        ({"lower": "0.4 * force_kN", "upper": 3.0}, 1.6, 3.0),
        (  # a meter's data sheet: of reading, and of range, and digits
            {
                "nominal": 2.0,
                "percent_of_reading": 0.1,
                "percent_of_full_scale": 0.05,
                "full_scale": 10.0,
                "deviation": 0.001,
            },
            1.992,
            2.008,
        ),
    ],
)
def test_the_limits_that_follow(more, lower, upper):
    found = ToleranceSettings(result="every output", unit="V", **more).permitted(AT)
    assert (found.lower, found.upper) == pytest.approx((lower, upper))


def test_every_output_has_the_limits_of_its_own_point_and_they_are_printed(run, tmp_path):
    own = 'result = "every output"\nunit = "V"\nnominal = "0.1 + 0.5*force_kN"\n'
    document = made(
        run, tmp_path, f"{own}percent_of_reading = 0.1\npercent_of_full_scale = 0.05\nfull_scale = 2"
    ).document
    assert [(one.what, one.tolerance) for one in document.statements] == [
        ("output at force 1 kN", "0.6 ± 0.0016 V"),
        ("output at force 4 kN", "2.1 ± 0.0031 V"),
    ]
    page = str(list(sections(document)))
    assert "0.6 ± 0.0016 V" in page
    basis = "nominal = 0.1 + 0.5*force_kN; 0.1 % of the nominal value; 0.05 % of full scale, 2 V"
    assert f"Tolerance of every output: {basis}." in page


@pytest.mark.parametrize(
    ("tolerance", "words"),
    [
        ("percent_of_reading = 0.1", "percent_of_reading needs nominal"),
        ("nominal = 1.0", "nominal needs deviation or percent_of_reading"),
        ("nominal = 1.0\npercent_of_full_scale = 0.1", "percent_of_full_scale and full_scale belong together"),
        ("nominal = 1.0\ndeviation = 1.0\nspan = 2.0", "percent_of_span and span belong together"),
        ("lower = 1.0\npercent_of_reading = 0.1", "lower or upper or both, or nominal with"),
        ('nominal = "2 * (force_kN"\ndeviation = 1.0', "nominal: "),
        ("nominal = 1.0\ndeviation = -1.0", "must be above 0"),
        ('nominal = "0"\npercent_of_reading = 1.0', "must be above 0"),
    ],
)
def test_combinations_that_say_nothing_are_refused_with_file_and_key(tmp_path, tolerance, words):
    text = f'[[tolerance]]\nresult = "every output"\nunit = "V"\n{tolerance}'
    settings = settled(tmp_path, text)
    with pytest.raises(ConfigurationError) as refused:
        make(CertificateRequest((tmp_path / "none",), date.fromisoformat(ISSUED), settings=settings))
    assert f"{settings}: tolerance.0" in str(refused.value)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("tolerance", "words"),
    [
        ('result = "every output"\nnominal = "2 * force_N"', "force_N is none of the settings at the point: they are"),
        ('result = "every coefficient"\nnominal = "2 * force_kN"', "a coefficient has none"),
        ('result = "every output"\nnominal = "log(force_kN - 4)"', "has no value at the point"),
        ('result = "every inferred"\nnominal = "force_kN"', "its value is the point by definition"),
        ('result = "every thing"\nnominal = 1', "no result has that label; there are: "),
    ],
)
def test_a_formula_without_a_value_at_a_point_is_a_reason(run, tmp_path, tolerance, words):
    with pytest.raises(Refused) as refused:
        made(run, tmp_path, f'{tolerance}\ndeviation = 1.0\nunit = "V"')
    (reason, *_) = refused.value.reasons
    assert words in reason
    assert f"({tmp_path}/certificate.toml: tolerance.0)" in reason


def test_a_percentage_of_a_reading_of_zero_says_what_to_add(run, tmp_path):
    with pytest.raises(Refused) as refused:
        made(run, tmp_path, 'result = "every output"\nunit = "V"\nnominal = "force_kN - 4"\npercent_of_reading = 1.0')
    (reason,) = refused.value.reasons
    assert "cell output at force 4 kN: nominal = 0 with a permitted deviation of 0 V" in reason
    assert "add deviation or percent_of_full_scale" in reason
