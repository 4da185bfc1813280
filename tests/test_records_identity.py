"""A finished thing is believed only where it belongs to the settings, the data, the weights and the code at hand."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import pytest

from embodied.records import (
    CODE,
    RecordError,
    differences,
    finished,
    identity_of,
    key_of,
    read_finished,
    write_finished,
)


@dataclass(frozen=True)
class Settings:
    batch: int = 6
    sizes: tuple[int, ...] = (1, 2)


def test_what_differs_is_named_with_both_values():
    before = identity_of(settings=Settings(), data="a")
    now = identity_of(settings=Settings(batch=5), data="a")
    assert differences(before, now) == ["settings.batch 6 -> 5"]
    assert differences(before, now, may_change=("batch",)) == [] == differences(before, before)
    assert differences(before, {**before, "begin": "x"}) == ["begin None -> 'x'"]
    assert key_of(before) != key_of(now) and len(key_of(now)) == 12


def test_a_finished_thing_of_other_settings_data_or_code_is_not_believed(tmp_path):
    mine = identity_of("embodied.seeds", settings=Settings(), data="a")
    path = tmp_path / "judged.json"
    assert finished(path, mine) is None
    write_finished(path, mine, {"success": 0.5})
    assert finished(path, mine) == {"success": 0.5} and read_finished(path)[0] == mine
    for other in ({"data": "b"}, {"settings": dataclasses.asdict(Settings(batch=1))}, {CODE: "f00"}):
        assert finished(path, {**mine, **other}) is None
    path.write_text('{"success": 0.5}')
    with pytest.raises(RecordError, match="judged.json has no identity"):
        finished(path, mine)
