"""Pictures of the cameras that a recording holds, nearest to its worst moments and all along it.

    scores -> moments -> log times of their frames -> images nearest in time -> small JPEG (Pillow, extra `images`)

Faces cannot be found reliably without a trained model, and one that was missed is shown. So the whole picture is
pixelated unless clear ones are asked for; nothing finer than its squares is kept.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from reba.analysis.exposure import worst_intervals
from reba.analysis.score_table import SCORES, ScoreTable
from reba.arrays import Array
from reba.checks import TEXT, accepts, one_of
from reba.errors import ReadError, RebaError, did_you_mean, join_names
from reba.extras import missing
from reba.file_names import text_without_folders
from reba.file_stamp import TRY_AGAIN, unchanged
from reba.files import sha256_of
from reba.readers.mcap import open_files, sniff
from reba.readers.mcap.frame_times import frame_times
from reba.readers.mcap.images import Camera, cameras_of
from reba.readers.mcap.layout import Undecodable
from reba.readers.recording.stream import ReadLog
from reba.report.pictures import LOOKS, Look, Picture, Pictures

BLOCKS: Final = 40
"""Squares on the longer side of a pixelated picture: a face that is a tenth of it wide has 4; a choice."""
PIXELS: Final = 320
"""Pixels on the longer side of a clear picture."""
MOMENTS: Final[dict[Look, int]] = {"pixelated": 200, "clear": 60}
"""Pictures along a recording, besides those of its worst moments; about half a megabyte."""
MOST_BYTES: Final = 600_000
"""Of all pictures in one report, before they become text."""
WITHIN: Final = 1.0
"""[s] A picture farther from its frame is not shown: a posture changes within a second."""
MOST_PIXELS: Final = 50_000_000
"""Of an image that is decoded: protects memory from declared sizes."""
TYPES: Final = "sensor_msgs/CompressedImage, foxglove.CompressedImage"


@accepts(RebaError, scores=SCORES, look=one_of(*LOOKS), topic=TEXT)
def camera_pictures(scores: ScoreTable, *, look: Look = "pixelated", topic: str = "", share: int = 1) -> Pictures:
    """Return pictures of a camera in the recording that scores were made of, for `reba.write_report`.

    Args:
        scores: of a recording of messages (MCAP, ROS bag, database).
        look: "pixelated", or "clear", in which people can be recognised.
        topic: of the camera; "" for the one with the most images.
        share: recordings in the report, which share its size.

    Returns:
        The pictures, without any where the recording has none; their `note` says why.

    Raises:
        RebaError: the recording has no such topic, or Pillow is not installed.
        ReadError: the recording cannot be read any more.

    Example:
        >>> import reba
        >>> reba.camera_pictures(reba.score({"trunk_flexion": [10.0]})).note
        'no pictures: DataFrame is no recording of messages with images of a camera'
    """
    postures = scores.postures
    source = Path(postures.source)
    given = [Path(path) for path in postures.files]
    if not all(path.exists() for path in given or [source]) or not sniff((given or [source])[0]):
        return Pictures(note=f"no pictures: {source.name} is no recording of messages with images of a camera")
    try:
        import PIL.Image  # noqa: F401
    except ImportError as error:
        raise missing("PIL", "a report with pictures", "images") from error
    if postures.quality.sha256 and source.exists() and postures.quality.sha256 != sha256_of(source):
        raise ReadError(source, "changed after it was read", hint=TRY_AGAIN)
    with unchanged(source):
        files = open_files(source, ReadLog(), given)
        cameras = cameras_of([file for file, _ in files])
        camera = next((one for one in cameras if topic in ("", one.topic)), None)
        if camera is None:
            names = [one.topic for one in cameras]
            if topic and names:
                listed = f"it has {join_names(names, 6)}{did_you_mean(topic, names)}"
                raise RebaError(f"{source.name} has no images on {topic!r}; {listed}")
            return Pictures(note=f"no pictures: {source.name} has no topic of compressed images ({TYPES})")
        time = _moments(scores, MOMENTS[look] // share)
        logged, _ = frame_times(files, postures, time)
        worst = {float(scores.time[one.frame]) for one in worst_intervals(scores)}
        # The worst moments first: each image stands once, and at them.
        moments = sorted(zip(time.tolist(), logged.tolist(), strict=True), key=lambda one: one[0] not in worst)
        available = sorted(_pictures(camera, moments, look), key=lambda one: one.time)
        camera.release()
    kept = _bounded(available, worst, MOST_BYTES // share)
    others = f"of {len(cameras)} cameras that with the most images is shown" if len(cameras) > 1 and not topic else ""
    note = others if kept else f"no pictures: no image of {source.name} could be read within {WITHIN:g} s of a moment"
    return Pictures(tuple(kept), BLOCKS if look == "pixelated" else 0, note, tuple(one.topic for one in cameras))


def _moments(scores: ScoreTable, count: int) -> Array:
    """Return the times [s] of the frames whose pictures are looked for: the worst, and some at equal distances."""
    time = scores.time
    if not len(time):
        return time
    even = np.searchsorted(time, np.linspace(time[0], time[-1], max(count, 2)))
    return time[np.unique([*even.tolist(), *(one.frame for one in worst_intervals(scores))])]


def _pictures(camera: Camera, moments: Sequence[tuple[float, int]], look: Look) -> Iterator[Picture]:
    """Yield the pictures of moments (time [s], log time [ns]), each image once; what cannot be read is left out."""
    seen = set()
    for time, logged in moments:
        try:
            image = camera.nearest(logged, round(WITHIN * 1e9))
        except (ReadError, Undecodable):
            continue
        if image is None or image.key in seen:
            continue
        seen.add(image.key)
        data = _reduced(image.data, look)
        if data is not None:
            yield Picture(time, (image.time - logged) / 1e9, data)


def _reduced(data: bytes, look: Look) -> bytes | None:
    """Return a small JPEG of an image, without what a camera may note in it (place, time, name); None if damaged."""
    from PIL import Image, ImageOps

    longest = BLOCKS if look == "pixelated" else PIXELS
    try:
        with Image.open(io.BytesIO(data), formats=("JPEG", "PNG", "WEBP")) as image:
            if image.width * image.height > MOST_PIXELS:
                return None
            image.draft("RGB", (2 * PIXELS, 2 * PIXELS))
            small: Any = ImageOps.exif_transpose(image).convert("RGB")
            small.thumbnail((longest, longest), Image.Resampling.BOX)
            out = io.BytesIO()
            clean = Image.new("RGB", small.size)
            clean.paste(small)
            clean.save(out, "JPEG", quality=80 if look == "pixelated" else 65, subsampling=0, optimize=True)
            return out.getvalue()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, EOFError):
        return None


def _bounded(pictures: list[Picture], worst: set[float], limit: int) -> list[Picture]:
    """Return the pictures without every second of those that are not of the worst moments, until they fit [bytes]."""
    while sum(len(one.data) for one in pictures) > limit:
        others = [one for one in pictures if one.time not in worst]
        if not others:
            return pictures[:1]
        left = {id(one) for one in others[::2]} if len(others) > 1 else {id(others[0])}
        pictures = [one for one in pictures if id(one) not in left]
    return pictures


def pictures_of_all(many: Sequence[ScoreTable], look: Look, topic: str) -> list[Pictures]:
    """Return the pictures of each recording of one report; one that fails has none, and a note that says why."""
    results = []
    for scores in many:
        try:
            results.append(camera_pictures(scores, look=look, topic=topic, share=len(many)))
        except ReadError as error:
            text = text_without_folders(str(error), scores.postures.source)
            results.append(Pictures(note=f"no pictures: {text}"))
    return results
