"""Logs whose documents are whole as JSON, and wrong: read, or refused by an error of ours."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import duoglide as dg
from duoglide.playback.rebuild import plan_of
from duoglide.playback.run_data import machine_of
from duoglide.storage import read_log

TRIES = 400
JUNK: tuple[Any, ...] = (
    None, True, -1, 0, 1e308, -1e308, 1e-320, float("nan"), "x", "", [], {}, [1, 2], [1, [2], 3],
    [[1, 2], [3, 4]], {"a": 1}, 2**70, 10**400,
)  # fmt: skip


def places(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """List where something can be put into a document; of long lists, only at the beginning."""
    keys: list[Any] = []
    if isinstance(value, dict):
        keys = list(value)
    elif isinstance(value, list):
        keys = list(range(min(len(value), 3)))
    for key in keys:
        yield (*place, key)
        yield from places(value[key], (*place, key))


def damaged(document: Any, text: str, noise: random.Random) -> Any:
    """Return a copy with one value gone, or another in its place."""
    copy = json.loads(text)
    *way, last = noise.choice(list(places(document)))
    target = copy
    for key in way:
        target = target[key]
    if noise.random() < 0.25:
        del target[last]
    else:
        target[last] = noise.choice(JUNK)
    return copy


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that no motion has
def test_wrong_documents_are_read_or_refused(run_log: Path) -> None:
    log, noise = read_log(run_log), random.Random(5)
    documents = {name: log.documents[name] for name in ("machine", "trajectory")}
    texts = {name: json.dumps(document) for name, document in documents.items()}
    refused = 0
    for _ in range(TRIES):
        name = noise.choice(list(documents))
        wrong = damaged(documents[name], texts[name], noise)
        changed = replace(log, documents={**documents, name: wrong})
        try:
            machine_of(changed)
            plan_of(changed)
        except dg.DuoglideError as error:
            assert len(str(error)) > 5
            refused += 1
    assert TRIES // 4 < refused < TRIES
