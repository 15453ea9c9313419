"""Names that change with every message hide nobody."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

import reba
from reba.readers.mcap.presence import MOST_NAMES, Presences
from tests.reba.readers.test_whole_recording import JOINTS, Row, angles, elbow, state, write
from tests.support import mcap_builder as make
from tests.support.mcap_builder import JOINT_STATE

SECOND = 1_000_000_000


def test_joints_in_another_order_in_every_message_are_the_same_joints(tmp_path: Path) -> None:
    generator = random.Random(3)
    count = MOST_NAMES // 7 + 600
    plain, mixed = [], []
    for at in range(count):
        # One joint comes when nearly as many orders have been there as are counted.
        joints = len(JOINTS) - (at < count - 300)
        order = generator.sample(range(joints), joints)
        stamp = make.EPOCH_NS + at * make.STEP_NS
        payload = make.joint_state(stamp, [JOINTS[joint] for joint in order], np.take(angles(at), order))
        plain.append(state(at, at, JOINTS[:joints]))
        mixed.append((1, stamp, payload))
    expected = reba.read(write(tmp_path / "plain.mcap", plain)).data
    found = reba.read(write(tmp_path / "mixed.mcap", mixed)).data
    np.testing.assert_array_equal(found.to_numpy(), expected.to_numpy())
    assert np.isfinite(found["neck_flexion"]).sum() == 300


def _two_topics(path: Path, rows: list[Row]) -> Path:
    definitions = [make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE))]
    definitions += [make.channel(1, 1, "/tags", "cdr"), make.channel(2, 1, "/joint_states", "cdr")]
    chunks = tuple(tuple(rows[at : at + 500]) for at in range(0, len(rows), 500))
    path.write_bytes(make.build(make.Plan(chunks, tuple(definitions))))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("person", [1, 2])
def test_a_person_behind_names_that_stand_once_is_read(tmp_path: Path, person: int) -> None:
    before = MOST_NAMES // 2 + 200
    tags = [state(at, at, (f"tag_{2 * at}", f"tag_{2 * at + 1}")) for at in range(before)]
    rows = tags + [state(at, at, JOINTS, channel=person) for at in range(before, before + 300)]
    table = reba.read(_two_topics(tmp_path / "tags.mcap", rows))
    np.testing.assert_array_equal(elbow(table), np.arange(before, before + 300))
    assert any("signals" in text for text in table.quality.warnings) == (person == 1)


def test_parts_of_a_set_are_counted_each_when_the_sets_are_too_many() -> None:
    names = [(f"frame_{number}", "map") for number in range(40)]
    generator = random.Random(5)
    presences = Presences()
    counts = dict.fromkeys(names, 0)
    for at in range(3 * MOST_NAMES // 10):
        some = tuple(generator.sample(names, 10))
        for name in some:
            counts[name] += 1
        presences.add(some, np.array([at * SECOND // 100]))
    found = dict.fromkeys(names, 0)
    for some, presence in presences.sets.items():
        for name in some:
            found[name] += presence.messages
    assert found == counts
    assert sum(map(len, presences.sets)) <= MOST_NAMES
