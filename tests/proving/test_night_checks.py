"""The checks of nights see what they are for: a good night, and what somebody changed in it afterwards."""

from __future__ import annotations

import json

import pytest

from proving.night.checks import INVARIANTS
from proving.night.judged import Night
from proving.night.play import play
from proving.night.scenario import LABS, draw
from rig.run_file.read.reader import RunReader

SEED = 503


@pytest.fixture(scope="module", params=LABS)
def good(request, tmp_path_factory):
    """A night in which all holds: what was played, its run list, its records."""
    print(f"rig night --lab {request.param} --seed {SEED}")
    played = play(draw(SEED, request.param), tmp_path_factory.mktemp("night"))
    with RunReader.open(played.path) as reader:
        found = played, reader.run_list(), tuple(reader.records())
    yield found
    played.bench.close()


def broken(night: Night) -> set[str]:
    return {name for name, check in INVARIANTS.items() if any(check(night))}


def told(good, change, *, which=5):
    """The night again, one accepted observation of it written down otherwise."""
    played, run_list, records = good
    accepted = [r for r in records if r.kind == "observation" and r.status == "accepted"]
    data = json.loads(accepted[which].body)
    change(data)
    otherwise = accepted[which]._replace(body=json.dumps(data))
    return Night(played, run_list, [otherwise if r is accepted[which] else r for r in records])


def happened(good, change):
    """The night again, what happened during one accepted observation of it otherwise; also what was said then."""
    played, run_list, records = good
    night = Night(played, run_list, list(records))
    record = list(night.accepted())[5]
    began, ended = night.measured_s(record)
    before = list(played.tape.readings)
    try:
        played.tape.readings[:] = [change(r) if began <= r.t_s and r.end_s <= ended else r for r in before]
        return Night(played, run_list, list(records))
    finally:
        played.tape.readings[:] = before


def first(data):
    return next(iter(data["outputs"].values()))["readings"]


def test_in_a_good_night_everything_holds(good):
    played, run_list, records = good
    assert broken(Night(played, run_list, list(records))) == set()


def test_a_reading_is_what_was_read_to_the_last_digit(good):
    def a_little_more(data):
        first(data)[1] *= 1.0 + 1e-7

    def the_other_way_round(data):
        first(data).reverse()

    def twice_the_same(data):
        first(data)[1] = first(data)[0]

    def temperature(data):
        data["temperatures"]["sensor_temperature_degC"]["readings"][0] += 0.002

    for change in (a_little_more, the_other_way_round, twice_the_same, temperature):
        assert broken(told(good, change)) == {"truthful"}, change


def test_a_reference_is_what_was_read_to_the_last_digit(good):
    def more(data):
        data["references"]["pressure_psia"]["readings"][0] += 1e-5

    if "references" in list(Night(*good).accepted())[5].data:
        assert broken(told(good, more)) == {"truthful"}
    else:
        assert good[0].scenario.lab == "attitude"


def test_a_reading_was_made_when_the_controller_says_it_was(good):
    def later(data):
        data["measured_s"] = [t + 1.0 for t in data["measured_s"]]

    def earlier(data):
        data["measured_s"] = [t - 1.0 for t in data["measured_s"]]

    for change in (later, earlier):
        assert "truthful" in broken(told(good, change)), change


def test_a_reading_is_the_truth_within_noise(good):
    """The instrument said this and the controller wrote it down, but it was not true."""
    volts = 1e-3 if good[0].scenario.lab == "attitude" else 2e-5
    off = happened(good, lambda r: r._replace(true=r.true + (volts if r.unit == "V" else 0.02)))
    assert broken(off) == {"truthful"}
    only_temperature = happened(good, lambda r: r._replace(true=r.true + (0.0 if r.unit == "V" else 0.02)))
    assert broken(only_temperature) == {"truthful"}


def test_a_number_repeated_from_elsewhere_is_found_even_if_noise_would_hide_it(good):
    played, run_list, records = good
    night = Night(played, run_list, list(records))
    began, ended = night.measured_s(list(night.accepted())[5])
    before, given = list(played.tape.readings), {}

    def hangs(r):
        if not (began <= r.t_s and r.end_s <= ended):
            return r
        return r._replace(found=r.found + 1e-6)  # whatever it said then, it found something else

    made = [hangs(r) for r in before]
    for i, r in enumerate(made):
        if r.given != r.found and (r.instrument, r.channel) not in given:  # the reading before said the same
            given[r.instrument, r.channel] = r.given
            j = max(j for j in range(i) if (made[j].instrument, made[j].channel) == (r.instrument, r.channel))
            made[j] = made[j]._replace(given=r.given)
    try:
        played.tape.readings[:] = made
        found = Night(played, run_list, list(records))
    finally:
        played.tape.readings[:] = before
    assert any("repeated since then" in what for what in INVARIANTS["truthful"](found))


def hung(good, degC):
    """The night with a thermometer that hung at one observation and at the reading before, which was `degC` off."""
    played, run_list, records = good
    column = "sensor_temperature_degC"
    at = played.plan.bench.temperatures[column]
    wire = (at.reader, at.channel)
    night = Night(played, run_list, list(records))
    record = list(night.accepted())[5]
    meanwhile, made = night.meanwhile(record, wire), night.of_input(wire)
    before, same = made[meanwhile[0] - 1], {id(made[i]): made[i] for i in meanwhile}
    said = before.given + degC
    data = json.loads(record.body)
    data["temperatures"][column]["readings"] = [said] * len(data["temperatures"][column]["readings"])
    kept = list(played.tape.readings)

    def hangs(r):
        if r is before:
            return r._replace(given=said, found=said)
        # by now it is half a degree warmer, which it does not say
        return r._replace(given=said, found=r.found + 0.5, true=r.true + 0.5) if id(r) in same else r

    try:
        played.tape.readings[:] = [hangs(r) for r in kept]
        return Night(played, run_list, [record._replace(body=json.dumps(data)) if r == record else r for r in records])
    finally:
        played.tape.readings[:] = kept


def test_what_a_thermometer_repeats_that_hangs_must_have_been_true_when_it_was_first_said(good):
    assert broken(hung(good, 0.0)) == set()
    assert broken(hung(good, 0.05)) == {"truthful"}


def test_a_thermometer_that_does_not_hang_is_held_against_the_truth_of_its_moment(good):
    warmer = happened(good, lambda r: r if r.unit == "V" else r._replace(true=r.true + 0.5))
    assert broken(warmer) == {"truthful"}


def repeated(good, *, outside, now_off=0.0):
    """The night with a pressure readback that repeats one said at the setpoint, or `outside` the band, before."""
    played, run_list, records = good
    night = Night(played, run_list, list(records))
    record = list(night.accepted())[5]
    began, ended = night.measured_s(record)
    column, channel = next(iter(record.data["references"].items()))
    setpoint, band = night.run_list.setting(night.point(record))[column], played.plan.procedure.settle.judged().band
    said = setpoint + (3.0 if outside else 0.3) * band
    kept = list(played.tape.readbacks)
    instrument = played.plan.bench.factors[column]
    first = next(i for i, b in enumerate(kept) if b.instrument == instrument and b.t_s >= began - 1e-6)
    before = max(i for i in range(first) if kept[i].instrument == instrument)

    def otherwise(i, b):
        if i == before:
            return b._replace(given=said, true=said)
        meanwhile = b.instrument == instrument and began - 1e-6 <= b.t_s <= ended
        return b._replace(given=said, true=setpoint + now_off * band) if meanwhile else b

    data = json.loads(record.body)
    data["references"][column]["readings"] = [said] * len(channel["readings"])
    try:
        played.tape.readbacks[:] = [otherwise(i, b) for i, b in enumerate(kept)]
        changed = [record._replace(body=json.dumps(data)) if r == record else r for r in records]
        return list(INVARIANTS["truthful"](Night(played, run_list, changed)))
    finally:
        played.tape.readbacks[:] = kept


def test_a_readback_that_hangs_must_have_been_true_within_the_band_and_be_within_it(good):
    if good[0].scenario.lab == "attitude":
        assert "references" not in list(Night(*good).accepted())[5].data
        return
    assert repeated(good, outside=False) == []
    assert "is off by" in repeated(good, outside=True)[0]
    assert "is off by" in repeated(good, outside=False, now_off=2.0)[0]


def test_where_it_came_from_and_which_stay_it_was_are_true(good):
    pressure = good[0].scenario.lab == "pressure"
    opposite = happened(good, lambda r: r._replace(sides={name: -side for name, side in r.sides.items()}))
    elsewhere = happened(good, lambda r: r._replace(factors={name: value + 0.5 for name, value in r.factors.items()}))
    another = happened(good, lambda r: r._replace(stay=r.stay + 1))
    warm = happened(good, lambda r: r._replace(air_degC={name: degC + 1.0 for name, degC in r.air_degC.items()}))
    planned = any(side for side in list(good[1].points[5].sides))
    assert broken(opposite) == ({"approached"} if planned else set())
    assert broken(elsewhere) == {"truthful"}
    assert broken(another) == ({"one stay"} if pressure else set())
    assert broken(warm) == ({"one stay"} if pressure else set())
