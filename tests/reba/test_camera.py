"""Pictures of a camera in the report: those nearest in time, small, pixelated unless asked, and the page says which."""

from __future__ import annotations

import io
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import reba
from reba import camera
from reba.cli import cli
from tests.support import bag_copies
from tests.support import camera_recordings as made
from tests.support.invoke import invoke
from tests.support.paths import DATASETS
from tests.support.says import says

FOXGLOVE = {
    "json": {"encode": made.as_json, "schema": ("foxglove.CompressedImage", "jsonschema", b"{}"), "encoding": "json"},
    "protobuf": {
        "encode": made.as_protobuf,
        "schema": ("foxglove.CompressedImage", "protobuf", made.protobuf_schema()),
        "encoding": "protobuf",
    },
}
WAYS: dict[str, dict[str, Any]] = {
    "ros": {},
    "ros without its definition": {"schema": (made.ROS, "ros2msg", b"")},
    **FOXGLOVE,
    "stamps of another clock": {"late": 5000.0},
}


def scored(path: Path) -> Any:
    return reba.score(reba.read(path), load=8.0)


def run(*words: str | Path) -> Any:
    return invoke(cli, [str(word) for word in words])


@pytest.mark.parametrize("way", WAYS)
def test_each_picture_is_the_one_recorded_nearest_to_its_frame(way: str, tmp_path: Path) -> None:
    path = made.write(tmp_path / "a.mcap", made.every(0.1), **WAYS[way])
    scores = scored(path)
    found = reba.camera_pictures(scores)
    worst = scores.summary()["worst"][0]["time"]
    assert abs(worst - made.WORST) < 1
    assert worst in [one.time for one in found.pictures]
    assert len(found.pictures) > 90
    for one in found.pictures:
        assert abs(one.after) <= 0.0501
        assert made.time_of(one.data) == pytest.approx(one.time + one.after, abs=0.25)


@pytest.mark.parametrize("container", bag_copies.COPIES)
def test_pictures_come_from_every_container(container: str, tmp_path: Path) -> None:
    motion = [*bag_copies.messages(bag_copies.write_motion(tmp_path / "motion.mcap"))]
    images = [
        (
            made.TOPIC,
            made.ROS,
            bag_copies.EPOCH_NS + index * 10**8,
            made.as_ros(index * 10**8, made.picture(index / 10)),
        )
        for index in range(40)
    ]
    path = bag_copies.COPIES[container](sorted([*motion, *images], key=lambda message: message[2]), tmp_path)
    report = tmp_path / "report.html"
    assert run("score", path, "--report", report, "--images", "clear").exit_code == 0
    found = reba.camera_pictures(scored(path))
    assert found.topics == (made.TOPIC,)
    assert len(found.pictures) >= 39
    assert report.read_text().count("data:image/") >= 39
    for one in found.pictures:
        assert made.time_of(one.data) == pytest.approx(one.time + one.after, abs=0.25)


@pytest.mark.parametrize(("look", "longest"), [("pixelated", camera.BLOCKS), ("clear", camera.PIXELS)])
def test_pictures_are_small_and_carry_nothing_else(look: Any, longest: int, tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x010E] = "Ann Lee"
    file = io.BytesIO()
    Image.new("RGB", (1600, 1200)).save(file, "JPEG", exif=exif)
    found = reba.camera_pictures(scored(made.write(tmp_path / "a.mcap", [(12.0, file.getvalue())])), look=look)
    (one,) = found.pictures
    assert b"Ann" not in one.data
    assert Image.open(io.BytesIO(one.data)).size == (longest, longest * 3 // 4)


def test_what_is_no_picture_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "MOST_PIXELS", 1_000_000)
    good = made.picture(12.0)
    bad = [b"", b"no image", good[:300], made.picture(3.0, (1200, 1200)), made.picture(3.0, kind="BMP")]
    images = [(2.0 + at, data) for at, data in enumerate(bad)]
    path = made.write(tmp_path / "a.mcap", [*images, (12.0, good)])
    assert [made.time_of(one.data) for one in reba.camera_pictures(scored(path)).pictures] == pytest.approx([12], abs=1)
    depth = made.write(tmp_path / "d.mcap", [(12.0, good)], encode=partial(made.as_ros, text="16UC1; compressedDepth"))
    assert "could be read" in reba.camera_pictures(scored(depth)).note


def test_a_picture_that_is_far_from_its_frame_is_not_shown(tmp_path: Path) -> None:
    found = reba.camera_pictures(scored(made.write(tmp_path / "a.mcap", [(3.0, made.picture(3.0))])))
    assert [abs(one.after) < camera.WITHIN for one in found.pictures] == [True]
    page = tmp_path / "a.html"
    reba.write_report(scored(tmp_path / "a.mcap"), page, pictures=found)
    assert page.read_text().count("data:image/jpeg") == 1, "at the cursor, not at the worst moment nine seconds later"


def test_the_size_of_the_pictures_is_bounded(tmp_path: Path) -> None:
    noisy = made.write(tmp_path / "a.mcap", made.every(0.1, size=(400, 300), noise=True))
    scores = scored(noisy)
    for share in (1, 4):
        found = camera.camera_pictures(scores, look="clear", share=share)
        assert sum(len(one.data) for one in found.pictures) <= camera.MOST_BYTES / share
        assert scores.summary()["worst"][0]["time"] in [one.time for one in found.pictures]


def test_of_several_cameras_one_is_shown_and_others_are_chosen_by_name(tmp_path: Path) -> None:
    path = made.write(tmp_path / "a.mcap", made.every(0.5), others=[(12.0, made.picture(20.0))])
    scores = scored(path)
    assert reba.camera_pictures(scores).note == "of 2 cameras that with the most images is shown"
    (other,) = reba.camera_pictures(scores, topic="/ann_lee/side").pictures
    assert made.time_of(other.data) == pytest.approx(20, abs=0.5)
    with pytest.raises(reba.RebaError) as error:
        reba.camera_pictures(scores, topic="/ann_lee/sid")
    says(error, "no images on '/ann_lee/sid'", "did you mean '/ann_lee/side'")


def test_a_report_has_no_pictures_unless_asked(tmp_path: Path) -> None:
    path = made.write(tmp_path / "a.mcap", made.every(0.5))
    page = tmp_path / "a.html"
    assert run("score", path, "--report", page).exit_code == 0
    text = page.read_text()
    assert "data:image" not in text
    assert "It contains no pictures." in text


@pytest.mark.parametrize("look", ["pixelated", "clear"])
def test_the_page_says_how_pictures_are_shown_and_names_no_camera(look: str, tmp_path: Path) -> None:
    path = made.write(tmp_path / "a.mcap", made.every(0.5))
    page = tmp_path / "a.html"
    assert run("score", path, "--report", page, "--images", look, "--camera", made.TOPIC).exit_code == 0
    text = page.read_text()
    assert "ann_lee" not in text
    assert "front/" not in text
    said = "pixelated as a whole to 40 squares" if look == "pixelated" else "people in them can be recognised"
    assert said in re.sub(r"\s+", " ", text)
    assert run("score", path, "--report", page, "--images", look, f"--camera={made.TOPIC}").exit_code == 0
    assert "ann_lee" not in page.read_text()


def test_without_images_the_report_says_why(tmp_path: Path) -> None:
    page = tmp_path / "a.html"
    for file in ("balancing_keypoints.trc", "simulated_palletising.mcap"):
        result = run("score", DATASETS / file, "--report", page, "--images", "clear")
        assert result.exit_code == 0
        assert f"note: no pictures: {file}" in result.output
        assert f"No pictures: {file}" in page.read_text()
        assert "It contains no pictures." in page.read_text()


def test_options_that_need_others_say_so(tmp_path: Path) -> None:
    path = made.write(tmp_path / "a.mcap", [])
    says(run("score", path, "--images", "clear"), "--report FILE.html")
    says(run("score", path, "--report", tmp_path / "a.html", "--camera", "/x"), "--images pixelated or clear")


def test_a_comparison_shows_pictures_of_both(tmp_path: Path) -> None:
    both = [made.write(tmp_path / f"{name}.mcap", made.every(0.5)) for name in "ab"]
    page = tmp_path / "ab.html"
    assert run("compare", *both, "--report", page, "--images", "pixelated").exit_code == 0
    assert page.read_text().count('class="camera pixelated"') >= 2
    assert np.all([len(page.read_text()) < 1_000_000])
