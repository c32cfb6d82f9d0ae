from __future__ import annotations

import json

from hypothesis import given, settings
from hypothesis import strategies as st

from duoglide.storage import (
    CycleRecord,
    EventKind,
    EventRecord,
    MotionRecord,
    Phase,
    Topic,
)
from duoglide.storage.schemas import schema_name, schema_of

increments = st.integers(-(2**31), 2**31 - 1)
words = st.integers(0, 0xFFFF)
cycle_records = st.builds(
    CycleRecord,
    cycle=st.integers(0, 2**40),
    phase=st.sampled_from(Phase),
    path_time=st.floats(0.0, 1e9),
    rate=st.floats(0.0, 1.0),
    setpoint=st.tuples(increments, increments, increments),
    actual=st.tuples(increments, increments, increments),
    controlword=st.tuples(words, words, words),
    statusword=st.tuples(words, words, words),
    lateness=st.integers(-(10**6), 10**9),
    missing=st.integers(0, 7),
)


@settings(max_examples=200, deadline=None)
@given(cycle_records)
def test_a_cycle_reads_back_to_the_last_bit(record: CycleRecord) -> None:
    assert CycleRecord.from_json(json.loads(record.to_json())) == record


@settings(max_examples=50, deadline=None)
@given(st.builds(EventRecord, st.sampled_from(EventKind), st.text(), st.integers(0, 3), words))
def test_an_event_reads_back(record: EventRecord) -> None:
    assert EventRecord.from_json(json.loads(record.to_json())) == record


def test_the_schemas_describe_exactly_what_is_written() -> None:
    three = (1.0, 2.0, 3.0)
    ints = (1, 2, 3)
    records = {
        Topic.CYCLE: CycleRecord(1, Phase.HOLD, 0.5, 1.0, ints, ints, ints, ints),
        Topic.EVENT: EventRecord(EventKind.NOTE, "x"),
        Topic.MOTION: MotionRecord(0.1, three, three, three, three, three),
    }
    assert set(records) == set(Topic)
    python = {"integer": int, "number": (int, float), "string": str, "array": list}
    for topic, record in records.items():
        schema = json.loads(schema_of(topic))
        assert schema["title"] == schema_name(topic)
        fields = json.loads(record.to_json())
        assert sorted(fields) == sorted(schema["required"]) == sorted(schema["properties"])
        for name, value in fields.items():
            assert isinstance(value, python[schema["properties"][name]["type"]]), name
