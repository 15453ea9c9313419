"""The MVNX reader: poses and angles, versions, damage, and XML that means harm."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import reba
from reba.errors import ProfileError, ReadError
from reba.readers.formats.mvnx import open_mvnx, sniff
from reba.readers.recording.stream import Recording
from tests.support.mvnx_text import ERGONOMIC, JOINTS, SEGMENTS, mvnx_text
from tests.support.says import says

RNG = np.random.default_rng(5)
TURNS = RNG.normal(size=(3, 23, 4))
TURNS /= np.linalg.norm(TURNS, axis=2, keepdims=True)
PLACES = RNG.normal(size=(3, 23, 3))
ANGLES = RNG.uniform(-90, 90, size=(3, 22, 3))
ERGO = RNG.uniform(-90, 90, size=(3, 6, 3))
SMALL = mvnx_text(TURNS, PLACES, ANGLES, ERGO)


def opened(folder: Path, text: str | bytes) -> Recording:
    path = folder / "small.mvnx"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return open_mvnx(path)


def test_segments_are_global_poses(tmp_path: Path) -> None:
    recording = opened(tmp_path, SMALL)
    stream = recording.streams[0]
    assert (stream.name, stream.kind, stream.names, stream.up) == ("segments", "frames", SEGMENTS, "z")
    assert (stream.parents, stream.count, stream.format) == (("",) * 23, 3, "MVNX 4 segments")
    (block,) = stream.blocks()
    np.testing.assert_allclose(block.time, [0, 0.017, 0.033])
    assert stream.epoch == 1.7e9
    np.testing.assert_allclose(block.values[..., :3], PLACES, atol=1e-6)
    np.testing.assert_allclose(block.values[..., [6, 3, 4, 5]], TURNS, atol=2e-6)
    np.testing.assert_allclose(np.linalg.norm(block.values[..., 3:], axis=2), 1.0)
    assert stream.rest is not None
    np.testing.assert_array_equal(stream.rest, np.tile([0.0, 1, 2, 0, 0, 0, 1], (23, 1)))
    assert recording.log.warnings == []


def test_joint_angles_are_degrees_by_their_names(tmp_path: Path) -> None:
    stream = opened(tmp_path, SMALL).streams[1]
    assert (stream.name, stream.kind, stream.unit, len(stream.names)) == ("jointAngle", "joints", "deg", 84)
    (block,) = stream.blocks(names=["jRightKnee_z", "Vertical_T8_x"])
    assert block.names == ("jRightKnee_z", "Vertical_T8_x")
    np.testing.assert_allclose(block.values[:, 0], ANGLES[:, JOINTS.index("jRightKnee"), 2], atol=1e-6)
    np.testing.assert_allclose(block.values[:, 1], ERGO[:, ERGONOMIC.index("Vertical_T8"), 0], atol=1e-6)


def test_version_3_names_its_ergonomic_angles_by_their_order(tmp_path: Path) -> None:
    recording = opened(tmp_path, mvnx_text(TURNS, PLACES, ANGLES, ERGO[:, :4], version=3))
    assert recording.streams[1].names[-3:] == ("Pelvis_T8_x", "Pelvis_T8_y", "Pelvis_T8_z")
    assert recording.streams[0].format == "MVNX 3 segments"


def test_what_is_not_read_is_listed(tmp_path: Path) -> None:
    topics = {topic.name: topic for topic in opened(tmp_path, SMALL).topics}
    assert topics["footContacts"].count == 3
    assert not topics["footContacts"].usable
    assert topics["segments"].usable


def without(*tags: str) -> str:
    text = SMALL
    for tag in tags:
        while f"<{tag}>" in text:
            start, end = text.index(f"<{tag}>"), text.index(f"</{tag}>") + len(tag) + 3
            text = text[:start] + text[end:]
    return text


def test_exports_of_a_part(tmp_path: Path) -> None:
    assert [stream.name for stream in opened(tmp_path, without("orientation")).streams] == ["jointAngle"]
    (stream,) = opened(tmp_path, without("jointAngle", "jointAngleErgo", "position")).streams
    (block,) = stream.blocks()
    assert np.isnan(block.values[..., :3]).all()
    assert not np.isnan(block.values[..., 3:]).any()


def test_a_cut_file_gives_its_whole_frames(tmp_path: Path) -> None:
    recording = opened(tmp_path, SMALL[: SMALL.rindex("<jointAngle>")])
    assert [stream.count for stream in recording.streams] == [2, 2]
    says(recording.log.ended_abnormally or "", "line", "2 frames")


def test_a_frame_of_wrong_size_is_skipped(tmp_path: Path) -> None:
    at = SMALL.rindex("<orientation>") + len("<orientation>")
    for damage in ("1 ", "x ", "1e300 ", "nan "):
        recording = opened(tmp_path, SMALL[:at] + damage + SMALL[at:])
        assert (recording.streams[0].count, recording.log.skipped) == (2, 1)
        says(recording.log.first_skipped or "", "line", "orientation")


def test_time_is_counted_where_frames_have_none(tmp_path: Path) -> None:
    recording = opened(tmp_path, SMALL.replace(' time="', ' zeit="'))
    np.testing.assert_allclose(next(recording.streams[0].blocks()).time, np.arange(3) / 60)
    assert recording.log.warnings


def test_times_that_stand_still_and_those_of_another_unit(tmp_path: Path) -> None:
    recording = opened(tmp_path, re.sub(r' time="[^"]*"', ' time="0"', SMALL))
    np.testing.assert_allclose(next(recording.streams[0].blocks()).time, np.arange(3) / 60)
    recording = opened(tmp_path, re.sub(r' time="(\d+)"', r' time="\g<1>000"', SMALL))
    says(recording.log.warnings[0], "16.5 s apart", "0.0166667 s by frameRate")


def test_of_several_subjects_one_is_chosen(tmp_path: Path) -> None:
    start, end = SMALL.index("<subject"), SMALL.index("</mvnx>")
    other = SMALL[start:end].replace('"Suit 1"', '"Suit 2"')
    recording = opened(tmp_path, SMALL[:end] + other + SMALL[end:])
    names = [f"Suit {number}/{stream}" for number in (1, 2) for stream in ("segments", "jointAngle")]
    assert [stream.name for stream in recording.streams] == names
    path = tmp_path / "small.mvnx"
    with pytest.raises(ProfileError, match="2 bodies or streams fit") as caught:
        reba.read(path)
    says(caught, "Suit 1/segments", "Suit 2/segments", "--topic")
    assert reba.read(path, topic="Suit 2/segments").topic == "Suit 2/segments"


def test_a_subject_without_a_whole_frame_is_counted(tmp_path: Path) -> None:
    start, end = SMALL.index("<subject"), SMALL.index("</mvnx>")
    other = SMALL[start:end].replace("<orientation>", "<orientation>1 ")
    recording = opened(tmp_path, SMALL[:end] + other + SMALL[end:])
    assert [stream.name for stream in recording.streams] == ["segments", "jointAngle"]
    assert recording.log.skipped == 3


BOMB = (
    '<?xml version="1.0"?><!DOCTYPE mvnx [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9))
    + "]><mvnx>&j;</mvnx>"
)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "the file is empty"),
        (BOMB, "line 1: a document type definition"),
        (BOMB.encode("utf-16"), "a document type definition"),
        ('<!DOCTYPE mvnx SYSTEM "file:///etc/hostname"><mvnx/>', "a document type definition"),
        ("<mvnx>&a;</mvnx>", "undefined entity"),
        ("<html></html>", "the root element is 'html', expected mvnx"),
        (b"\x00\xff\xfe garbage", "line 1: "),
        ("<mvnx>" + "<a>" * 100_000, "elements nested deeper than 100"),
        ("<mvnx><subject><segments>" + "<segment/>" * 2000, "more than 1000 elements segment"),
        ("<mvnx>" + "<subject/>" * 60, "more than 50 subjects"),
        (SMALL[:3000], "no complete frame before"),
        (SMALL[: SMALL.index('type="normal"') - 80] + "</frames></subject></mvnx>", "no complete frame"),
        (without("orientation", "jointAngle", "jointAngleErgo"), "neither 'orientation' nor 'jointAngle'"),
        (
            SMALL.replace("<orientation>", "<orientation>1 "),
            "no complete frame | first of 3 | orientation",
        ),
    ],
)
def test_damage_is_told(tmp_path: Path, text: str | bytes, what: str) -> None:
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, text)
    says(caught, *what.split(" | "))


def test_sniff_looks_at_the_content() -> None:
    assert sniff(Path("a.xml"), SMALL.encode()[:200])
    assert not sniff(Path("a.xml"), b"<?xml version='1.0'?><html>")
    assert not sniff(Path("a.mvnx"), b"time,x")


@pytest.mark.parametrize("encoding", ["ATF-8", "utf-7", "shift_jis", "rot13"])
def test_an_encoding_that_cannot_be_read_is_one_error(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "odd.mvnx"
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?>\n<mvnx version="4"></mvnx>')
    with pytest.raises(ReadError) as caught:
        open_mvnx(path)
    says(caught, "odd.mvnx")
