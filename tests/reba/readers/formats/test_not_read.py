"""Formats that people have and that are not read: one line each says what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from reba.errors import ReadError
from reba.readers import read
from reba.readers.formats import FORMATS, is_recording
from reba.readers.formats.not_read import not_read
from tests.support.says import says

BYTES = b"\x00\x01\x02binary" * 20


@pytest.mark.parametrize("ending", [ending for known in not_read() for ending in known.endings])
@pytest.mark.parametrize("name", ["walk", "WALK.C3D", "walk.with.dots"])
def test_the_ending_says_what_to_do(tmp_path: Path, ending: str, name: str) -> None:
    path = tmp_path / (name + (ending.upper() if name.isupper() else ending))
    path.write_bytes(BYTES)
    known = next(known for known in not_read() if ending in known.endings)
    with pytest.raises(ReadError) as caught:
        read(path)
    says(caught, path.name, known.what, "is not read", known.hint)
    assert not is_recording(path)


@pytest.mark.parametrize("start", [start for known in not_read() for start in known.starts])
@pytest.mark.parametrize("name", ["walk.xyz", "walk.bvh", "walk.csv", "walk.trc"])
def test_the_first_bytes_decide_whatever_the_name_is(tmp_path: Path, start: str, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(start.encode("latin-1") + BYTES)
    known = next(known for known in not_read() if start in known.starts)
    with pytest.raises(ReadError) as caught:
        read(path)
    says(caught, name, known.what, known.hint)


def test_a_readable_file_is_read_under_any_name(tmp_path: Path) -> None:
    path = tmp_path / "walk.vpr"
    path.write_text("time,trunk_flexion\n0,10\n0.1,11\n")
    assert len(read(path).data) == 2
    empty = tmp_path / "walk.fbx"
    empty.write_bytes(b"")
    with pytest.raises(ReadError) as caught:
        read(empty)
    says(caught, "the file is empty")


def test_no_format_is_both_read_and_not() -> None:
    endings = [ending for known in not_read() for ending in known.endings]
    assert len(set(endings)) == len(endings)
    assert not {ending for form in FORMATS for ending in form.extensions} & set(endings)
    assert all(known.endings for known in not_read())


def test_fbx_names_the_command(tmp_path: Path) -> None:
    path = tmp_path / "walk.fbx"
    path.write_bytes(b"Kaydara FBX Binary  \x00\x1a\x00" + BYTES)
    with pytest.raises(ReadError) as caught:
        read(path)
    says(caught, "BVH", "Blender", "blender -b --python-expr", "import_scene.fbx", "export_anim.bvh", "frame_range")
