"""WebSocket server of scores and a coloured skeleton for Foxglove and Lichtblick.

Topics: `/ergonomics/reba`, the records as JSON with a schema, for plots and alerts; `/ergonomics/notice`, what happens
to the signal; `/ergonomics/figure`, a `foxglove.SceneUpdate` in the frame `reba`, for the 3D panel.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from reba.arrays import Array
from reba.errors import RebaError
from reba.extras import missing
from reba.live.frames import Frames
from reba.live.notices import KINDS
from reba.live.output import encoder
from reba.live.session import LEVELS
from reba.method.scoring import SCORE_COLUMNS, ScoreArrays
from reba.method.tables import PART_MAXIMA, UNKNOWN
from reba.posture.columns import INDEX
from reba.posture.factors import SUPPORTS
from reba.posture.skeleton import LENGTHS, LIMBS, joints
from reba.provenance import MEMBER
from reba.writers.json_messages import without_missing

PORT: Final = 8765
TOPICS: Final = {"scores": "/ergonomics/reba", "notices": "/ergonomics/notice", "figure": "/ergonomics/figure"}
FRAME: Final = "reba"
"""Name of the coordinate frame of the skeleton."""
SCENE_PERIOD: Final = 1.0 / 30.0
"""[s] Between two skeletons, as smooth as video."""
LIMB_WIDTH: Final = 0.05
"""[m] Of the lines of the skeleton."""


class FoxgloveServer:
    """WebSocket server of scores and skeletons; port 0 stands for any free port.

    Raises:
        RebaError: foxglove-sdk is not installed, or the port is taken.
    """

    def __init__(self, port: int = PORT, host: str = "127.0.0.1") -> None:
        try:
            import foxglove
            from foxglove import messages
            from foxglove.channels import SceneUpdateChannel
        except ImportError as error:
            raise missing("foxglove", "--foxglove") from error
        self._messages = messages
        # Its messages quote what clients send, escape codes as they are; what they ask is no matter of the command.
        logging.getLogger("foxglove").setLevel(logging.CRITICAL + 1)
        # Referenced as long as the server lives: channels close with their context.
        context = self._context = foxglove.Context()
        schema = foxglove.Schema(name="reba.Live", encoding="jsonschema", data=encoder()(record_schema()))
        self._scores = foxglove.Channel(TOPICS["scores"], schema=schema, message_encoding="json", context=context)
        schema = foxglove.Schema(name="reba.Notice", encoding="jsonschema", data=encoder()(notice_schema()))
        self._notices = foxglove.Channel(TOPICS["notices"], schema=schema, message_encoding="json", context=context)
        self._skeletons = SceneUpdateChannel(TOPICS["figure"], context=context)
        try:
            self._server = foxglove.start_server(name="reba live", host=host, port=port, context=context)
        except (RuntimeError, OSError, ValueError) as error:
            raise RebaError(f"port {port} cannot be used ({error}); choose another with --foxglove PORT") from error
        self.address = f"ws://{host}:{self._server.port}"
        self._next_scene = -np.inf
        self._newest: tuple[SkeletonMarkers, Mapping[str, Any], int] | None = None

    def publish(self, frames: Frames, records: Sequence[Mapping[str, Any]], scores: ScoreArrays, epoch: float) -> None:
        """Send one record per scored frame, and the skeleton of the newest frame once per `SCENE_PERIOD`.

        `epoch` is the Unix time of time 0 [s]; for 0 the frames get the current time.
        """
        now = time.time_ns()
        encode = encoder()
        stamps = [round((epoch + moment) * 1e9) if epoch > 0 else now for moment in frames.time.tolist()]
        for record, stamp in zip(records, stamps, strict=True):
            self._scores.log(encode(without_missing(record)), log_time=stamp)
        newest = float(frames.time[-1])
        if newest >= self._next_scene:
            self._next_scene = newest + SCENE_PERIOD - 1e-6
            support = np.broadcast_to(frames.factors.support, len(frames.time))[-1]
            skeleton = skeleton_markers(frames.angles[-1], scores, len(stamps) - 1, sitting=support == SUPPORTS[3])
            self._skeletons.log(self.scene(skeleton, records[-1], stamps[-1]), log_time=stamps[-1])
            self._newest = skeleton, records[-1], stamps[-1]

    def publish_notice(self, line: Mapping[str, Any]) -> None:
        """Send a notice; without a signal the newest skeleton turns grey, as its score is out of date."""
        stamp = self._newest[2] if self._newest is not None else time.time_ns()
        self._notices.log(encoder()(line), log_time=stamp)
        if self._newest is not None and not line["notice"]["followed"]:
            skeleton, record, _ = self._newest
            grey = replace(skeleton, colours=(GREY,) * len(skeleton.colours), head_colour=GREY)
            self._skeletons.log(self.scene(grey, record, stamp, signal=False), log_time=stamp)
            self._next_scene = -np.inf

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()

    def scene(self, skeleton: SkeletonMarkers, record: Mapping[str, Any], stamp: int, *, signal: bool = True) -> Any:
        """Return the `foxglove.SceneUpdate` of a skeleton with its REBA score; `stamp` [ns since 1970].

        Without a `signal` the text says so.
        """
        make = self._messages

        def colour(rgba: Colour) -> Any:
            red, green, blue, alpha = rgba
            return make.Color(r=red, g=green, b=blue, a=alpha)

        def pose(*at: float) -> Any:
            x, y, z = at
            return make.Pose(
                position=make.Vector3(x=x, y=y, z=z), orientation=make.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
            )

        points = [make.Point3(x=x, y=y, z=z) for x, y, z in skeleton.lines.reshape(-1, 3).tolist()]
        size = STATURE * LENGTHS["head"]
        low, high = record["reba_low"], record["reba_high"]
        text = f"REBA {low}" if low == high else f"REBA {low} to {high}"
        entity = make.SceneEntity(
            timestamp=make.Timestamp(sec=stamp // 10**9, nsec=stamp % 10**9),
            frame_id=FRAME,
            id="person",
            lines=[
                make.LinePrimitive(
                    type=make.LinePrimitiveLineType.LineList,
                    pose=pose(0.0, 0.0, 0.0),
                    thickness=LIMB_WIDTH,
                    points=points,
                    colors=[colour(rgba) for rgba in skeleton.colours for _ in range(2)],
                )
            ],
            spheres=[
                make.SpherePrimitive(
                    pose=pose(*skeleton.head.tolist()),
                    size=make.Vector3(x=size, y=size, z=size),
                    color=colour(skeleton.head_colour),
                )
            ],
            texts=[
                make.TextPrimitive(
                    pose=pose(*(skeleton.head + np.array([0.0, 0.0, size])).tolist()),
                    billboard=True,
                    font_size=0.12,
                    color=colour((1.0, 1.0, 1.0, 1.0)),
                    text=text if signal else f"no signal, last {text}",
                )
            ],
        )
        return make.SceneUpdate(entities=[entity])


def record_schema() -> dict[str, Any]:
    """Return the JSON schema of a record: one plain type per property, see `reba.writers.json_messages`."""
    number, score = {"type": "number"}, {"type": "integer", "description": "absent: not determined by the measured"}
    means = dict.fromkeys(("mean", "mean_low", "mean_high"), number)
    levels = dict.fromkeys((*map(str, range(LEVELS)), "undetermined"), number)
    members = {
        "window": {"seconds": number, **means, "share_above": number},
        "exposure": {
            "seconds": number,
            "missing": number,
            **means,
            "action_levels": {"type": "object", "properties": levels},
        },
        "alert": {"active": {"type": "boolean"}, "since": number, "event": {"type": "string"}},
        MEMBER: {"version": {"type": "string"}},
    }
    return {
        "title": "reba.Live",
        "type": "object",
        "properties": {
            "time": {"type": "number", "description": "seconds"},
            **dict.fromkeys(SCORE_COLUMNS, score),
            **{name: {"type": "object", "properties": fields} for name, fields in members.items()},
        },
    }


def notice_schema() -> dict[str, Any]:
    """Return the JSON schema of the line of a notice; every property has one plain type, as viewers need it."""
    number = {"type": "number"}
    notice = {
        "kind": {"type": "string", "description": "; ".join(f"{kind}: {text}" for kind, text in KINDS.items())},
        "text": {"type": "string"},
        "followed": {"type": "boolean", "description": "whether frames follow; if not, the scores are out of date"},
        "missing": number,
    }
    members = {
        "notice": notice,
        "exposure": {"seconds": number, "missing": number},
        "alert": {"active": {"type": "boolean"}},
        MEMBER: {"version": {"type": "string"}},
    }
    return {
        "title": "reba.Notice",
        "type": "object",
        "properties": {
            "time": {"type": "number", "description": "seconds, of the last frame before"},
            **{name: {"type": "object", "properties": fields} for name, fields in members.items()},
        },
    }


Colour = tuple[float, float, float, float]
STATURE: Final = 1.75
"""[m] Of the drawn person."""
GREY: Final[Colour] = (0.6, 0.6, 0.6, 0.6)
"""Colour of limbs whose part score is undetermined."""
COLOUR_SCALE: Final[tuple[Colour, ...]] = ((0.18, 0.63, 0.30, 1.0), (0.98, 0.75, 0.18, 1.0), (0.80, 0.14, 0.14, 1.0))
"""Colours from the lowest to the highest part score: green, yellow, red."""
CROSS_LINES: Final[tuple[tuple[str, str, str], ...]] = (
    ("shoulder_left", "shoulder_right", "trunk"),
    ("hip_left", "hip_right", "legs"),
)
"""Lines across the shoulders and the hips: both ends, and the part whose colour they have."""


@dataclass(frozen=True)
class SkeletonMarkers:
    """m lines and the head of a coloured skeleton.

    Attributes:
        lines: (m, 2, 3) their ends [m]: x forward, y to the left, z up; the feet stand on z = 0.
        head: (3,) centre of the head [m].
    """

    lines: Array
    colours: tuple[Colour, ...]
    head: Array
    head_colour: Colour


def part_of(limb: str) -> str:
    """Return the part whose score colours a limb.

    >>> part_of("shank_left"), part_of("wrist_right")
    ('legs', 'wrist_right')
    """
    return "legs" if limb.startswith(("thigh", "shank")) else limb


def colour_of(part: str, score: int) -> Colour:
    """Return the colour of a part score, interpolated in `COLOUR_SCALE` between its lowest and highest value."""
    if score == UNKNOWN:
        return GREY
    highest = next(maximum for name, maximum in PART_MAXIMA.items() if part.startswith(name))
    position = (score - 1) / (highest - 1) * (len(COLOUR_SCALE) - 1)
    below = min(int(position), len(COLOUR_SCALE) - 2)
    share = position - below
    red, green, blue, alpha = (
        (1 - share) * a + share * b for a, b in zip(COLOUR_SCALE[below], COLOUR_SCALE[below + 1], strict=True)
    )
    return red, green, blue, alpha


def skeleton_markers(angles: Array, scores: ScoreArrays, frame: int, sitting: bool = False) -> SkeletonMarkers:
    """Return the skeleton of one posture (22,) [deg], coloured by the scores of its `frame`.

    NaN (not measured) is drawn neutral, and grey if the part score is undetermined.
    """
    positions = joints(angles, sitting)
    floor = min(float(point[1]) for point in positions.values())
    at = {name: STATURE * np.array([p[0], -p[2], p[1] - floor]) for name, p in positions.items()}
    drawn = [(a, b, part_of(limb)) for limb, (a, b, _) in LIMBS.items()]
    drawn += [(a, a.replace("ankle", "toe"), "legs") for a in at if a.startswith("ankle")]
    drawn += CROSS_LINES
    colour = {part: colour_of(part, int(scores[part][frame])) for _, _, part in drawn}
    neck = GREY if np.isnan(angles[INDEX["neck_flexion"]]) else colour["neck"]
    return SkeletonMarkers(
        lines=np.array([(at[a], at[b]) for a, b, _ in drawn]),
        colours=tuple(colour[part] for _, _, part in drawn),
        head=at["head"],
        head_colour=neck,
    )
