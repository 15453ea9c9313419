"""Header of a stream: one parent of a frame at a time, also of a static one."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from reba.posture.angles import unit
from reba.readers.mapping.reference_frames import FrameTree
from reba.readers.recording.quaternions import rotated
from reba.readers.recording.stream import ReadLog
from tests.reba.readers.mcap.test_streams import TF, joined, poses, tf_message, transform, write
from tests.support.mcap_builder import EPOCH_NS, STEP_NS
from tests.support.says import says


@pytest.mark.parametrize("below", [1, 2])
def test_a_static_frame_below_a_renamed_one_is_followed(tmp_path: Path, below: int) -> None:
    """A mount that is published again below the new name of its cart, directly or below another static frame."""
    fixed, values = [1.0, 2, 3, 0, 0, 0, 1], poses(400, 1)[:, 0]
    rows = []
    for at in range(400):
        stamp, cart = EPOCH_NS + at * STEP_NS, "map_cart" if at < 200 else "odom_cart"
        if at % 200 == 0:
            chain = [cart, *[f"{cart}_plate"] * (below - 1), "tracker"]
            links = (transform(stamp, *pair, fixed) for pair in pairwise(chain))
            rows.append((2, stamp, tf_message(*links)))
        rows.append((1, stamp, tf_message(transform(stamp, "world", cart, values[at]))))
    opened = write(tmp_path / "tf.mcap", rows, c1=("/tf", TF), c2=("/tf_static", TF))
    log = ReadLog()
    tree = FrameTree(opened.streams[0], ("tracker",))
    found = np.concatenate([tree.world(block, "tracker")[1] for block in opened.streams[0].blocks(log)])
    expected = np.array(values[:, :3]) + below * rotated(unit(values[:, 3:]), np.array([[1.0, 2, 3]]))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert not any("parents" in text for text in log.warnings)


def test_a_static_frame_may_be_fixed_to_another_parent(tmp_path: Path) -> None:
    """A camera that is taken off a cart and fixed to the wall, and later back to the cart."""
    values, turns = poses(600, 1)[:, 0], {0: "cart", 200: "wall", 450: "cart"}
    rows = []
    for at in range(600):
        stamp = EPOCH_NS + at * STEP_NS
        if at in turns:
            rows.append((2, stamp, tf_message(transform(stamp, turns[at], "camera", [1.0, 2, at, 0, 0, 0, 1]))))
        rows.append((1, stamp, tf_message(transform(stamp, "world", "cart", values[at]))))
    log = ReadLog()
    opened = write(tmp_path / "tf.mcap", rows, c1=("/tf", TF), c2=("/tf_static", TF))
    tree = FrameTree(opened.streams[0], ("camera",))
    found = np.concatenate([tree.world(block, "camera")[1] for block in opened.streams[0].blocks(log)])
    offset = np.array([[1.0, 2, 450 if at >= 450 else 0] for at in range(600)])
    expected = values[:, :3] + rotated(unit(values[:, 3:]), offset)
    expected[200:450] = [1.0, 2, 200]
    np.testing.assert_allclose(found, expected, atol=1e-9)
    says(" ".join(log.warnings), "'camera'", "2.00 s, 4.50 s")
    assert "parents" not in " ".join(log.warnings)


def test_a_static_frame_with_two_parents_at_once_is_told(tmp_path: Path) -> None:
    fixed, values = [1.0, 2, 3, 0, 0, 0, 1], poses(100, 2)
    rows = [(2, EPOCH_NS, tf_message(*(transform(EPOCH_NS, f"s{k}", "tracker", fixed) for k in (0, 1))))]
    for at in range(100):
        stamp = EPOCH_NS + at * STEP_NS
        rows.append((1, stamp, tf_message(*(transform(stamp, "world", f"s{k}", values[at, k]) for k in (0, 1)))))
    log = ReadLog()
    joined(write(tmp_path / "tf.mcap", rows, c1=("/tf", TF), c2=("/tf_static", TF)), log)
    says(" ".join(log.warnings), "'tracker' has the parents 's0' and 's1' at once")
