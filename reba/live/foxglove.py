"""Scores and a coloured figure to Foxglove or Lichtblick, which connect to a WebSocket that is served here.

Topics: `/ergonomics/reba`, the records as JSON with a schema, to plot and to alert on; `/ergonomics/figure`, a
`foxglove.SceneUpdate` in the frame `reba`, for the 3D panel.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from reba.arrays import Array
from reba.errors import RebaError
from reba.live.frames import Frames
from reba.live.output import encoder
from reba.method.scoring import SCORE_COLUMNS, UNKNOWN, ScoreArrays
from reba.method.tables import PART_MAXIMA
from reba.posture.columns import INDEX
from reba.posture.factors import SUPPORTS
from reba.posture.skeleton import LENGTHS, LIMBS, joints

PORT: Final = 8765
TOPICS: Final = {"scores": "/ergonomics/reba", "figure": "/ergonomics/figure"}
FRAME: Final = "reba"
"""Name of the coordinate frame of the figure."""
SCENE_PERIOD: Final = 1.0 / 30.0
"""[s] Figures are not sent more often: no screen shows more."""
THICK: Final = 0.05
"""[m] Of a limb."""


class FoxgloveServer:
    """A server to look at scores.

    Args:
        port: to listen on; 0 for any free one.
        host: address to listen on.

    Raises:
        RebaError: foxglove-sdk is not installed, or the port is taken.
    """

    def __init__(self, port: int = PORT, host: str = "127.0.0.1") -> None:
        try:
            import foxglove
            from foxglove import messages
            from foxglove.channels import SceneUpdateChannel
        except ImportError as error:
            raise RebaError("--foxglove needs foxglove-sdk; install it with `pip install dreba[live]`") from error
        self._messages = messages
        # Kept: its channels close with it.
        context = self._context = foxglove.Context()
        schema = foxglove.Schema(name="reba.Live", encoding="jsonschema", data=encoder()(record_schema()))
        self._scores = foxglove.Channel(TOPICS["scores"], schema=schema, message_encoding="json", context=context)
        self._figures = SceneUpdateChannel(TOPICS["figure"], context=context)
        try:
            self._server = foxglove.start_server(name="reba live", host=host, port=port, context=context)
        except (RuntimeError, OSError, ValueError) as error:
            raise RebaError(f"port {port} cannot be used ({error}); choose another with --foxglove PORT") from error
        self.address = f"ws://{host}:{self._server.port}"
        self._next = -np.inf

    def publish(self, frames: Frames, records: Sequence[Mapping[str, Any]], scores: ScoreArrays, epoch: float) -> None:
        """Send the records of n frames, and the figure of the newest of them if it is time for one.

        Args:
            frames: what was scored.
            records: one for each frame.
            scores: of the frames.
            epoch: Unix time [s] of time 0; where it is 0, frames are stamped with the time now.
        """
        now = time.time_ns()
        encode = encoder()
        stamps = [round((epoch + moment) * 1e9) if epoch > 0 else now for moment in frames.time.tolist()]
        for record, stamp in zip(records, stamps, strict=True):
            self._scores.log(encode(record), log_time=stamp)
        newest = float(frames.time[-1])
        if newest >= self._next:
            self._next = newest + SCENE_PERIOD - 1e-6
            support = np.broadcast_to(frames.factors.support, len(frames.time))[-1]
            shown = figure(frames.angles[-1], scores, len(stamps) - 1, sitting=support == SUPPORTS[3])
            self._figures.log(self._scene(shown, records[-1], stamps[-1]), log_time=stamps[-1])

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()

    def _scene(self, shown: SkeletonMarkers, record: Mapping[str, Any], stamp: int) -> Any:
        make = self._messages

        def colour(given: Colour) -> Any:
            red, green, blue, alpha = given
            return make.Color(r=red, g=green, b=blue, a=alpha)

        def pose(*at: float) -> Any:
            x, y, z = at
            return make.Pose(
                position=make.Vector3(x=x, y=y, z=z), orientation=make.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
            )

        points = [make.Point3(x=x, y=y, z=z) for x, y, z in shown.lines.reshape(-1, 3).tolist()]
        size = STATURE * LENGTHS["head"]
        low, high = record["reba_low"], record["reba_high"]
        entity = make.SceneEntity(
            timestamp=make.Timestamp(sec=stamp // 10**9, nsec=stamp % 10**9),
            frame_id=FRAME,
            id="person",
            lines=[
                make.LinePrimitive(
                    type=make.LinePrimitiveLineType.LineList,
                    pose=pose(0.0, 0.0, 0.0),
                    thickness=THICK,
                    points=points,
                    colors=[colour(given) for given in shown.colours for _ in range(2)],
                )
            ],
            spheres=[
                make.SpherePrimitive(
                    pose=pose(*shown.head.tolist()),
                    size=make.Vector3(x=size, y=size, z=size),
                    color=colour(shown.head_colour),
                )
            ],
            texts=[
                make.TextPrimitive(
                    pose=pose(*(shown.head + np.array([0.0, 0.0, size])).tolist()),
                    billboard=True,
                    font_size=0.12,
                    color=colour((1.0, 1.0, 1.0, 1.0)),
                    text=f"REBA {low}" if low == high else f"REBA {low} to {high}",
                )
            ],
        )
        return make.SceneUpdate(entities=[entity])


def record_schema() -> dict[str, Any]:
    """Return the JSON schema of a record."""
    number = {"type": ["number", "null"]}
    score = {"type": ["integer", "null"], "description": "null = not determined by what was measured"}
    means = {"mean": number, "mean_low": number, "mean_high": number}
    window = {"seconds": number, **means, "share_above": number}
    exposure = {"seconds": number, **means, "action_levels": {"type": "object", "additionalProperties": number}}
    alert = {"active": {"type": "boolean"}, "since": number, "event": {"type": ["string", "null"]}}
    return {
        "title": "reba.Live",
        "type": "object",
        "properties": {
            "time": {"type": "number", "description": "seconds"},
            **dict.fromkeys(SCORE_COLUMNS, score),
            **{
                name: {"type": "object", "properties": fields}
                for name, fields in {"window": window, "exposure": exposure, "alert": alert}.items()
            },
        },
    }


Colour = tuple[float, float, float, float]
STATURE: Final = 1.75
"""[m] The size of the figure."""
GREY: Final[Colour] = (0.6, 0.6, 0.6, 0.6)
"""Limbs whose part score is not determined."""
SCALE: Final[tuple[Colour, ...]] = ((0.18, 0.63, 0.30, 1.0), (0.98, 0.75, 0.18, 1.0), (0.80, 0.14, 0.14, 1.0))
"""From the lowest part score to the highest."""
PLAIN: Final[tuple[tuple[str, str, str], ...]] = (
    ("shoulder_left", "shoulder_right", "trunk"),
    ("hip_left", "hip_right", "legs"),
)
"""Lines that are no limbs, and the part whose colour they take."""


@dataclass(frozen=True)
class SkeletonMarkers:
    """Points to draw.

    Attributes:
        lines: (m, 2, 3) ends of m lines [m]: x forward, y to the left, z up; the feet stand on z = 0.
        colours: of each line.
        head: (3,) centre of the head [m].
        head_colour: of the head.
    """

    lines: Array
    colours: tuple[Colour, ...]
    head: Array
    head_colour: Colour


def part_of(limb: str) -> str:
    """Return the part score that colours a limb.

    >>> part_of("shank_left"), part_of("wrist_right")
    ('legs', 'wrist_right')
    """
    return "legs" if limb.startswith(("thigh", "shank")) else limb


def colour_of(part: str, score: int) -> Colour:
    """Return the colour of a part score on the way from its lowest to its highest value."""
    if score == UNKNOWN:
        return GREY
    highest = next(most for name, most in PART_MAXIMA.items() if part.startswith(name))
    place = (score - 1) / (highest - 1) * (len(SCALE) - 1)
    below = min(int(place), len(SCALE) - 2)
    share = place - below
    red, green, blue, alpha = ((1 - share) * a + share * b for a, b in zip(SCALE[below], SCALE[below + 1], strict=True))
    return red, green, blue, alpha


def figure(angles: Array, scores: ScoreArrays, frame: int, sitting: bool = False) -> SkeletonMarkers:
    """Return the figure of one frame.

    Args:
        angles: (22,) degrees, NaN = not measured, drawn neutral and grey where it leaves the part score open.
        scores: of n frames.
        frame: which of them.
        sitting: whether the person sits.
    """
    place = joints(angles, sitting)
    floor = min(float(point[1]) for point in place.values())
    at = {name: STATURE * np.array([p[0], -p[2], p[1] - floor]) for name, p in place.items()}
    drawn = [(a, b, part_of(limb)) for limb, (a, b, _) in LIMBS.items()]
    drawn += [(a, a.replace("ankle", "toe"), "legs") for a in at if a.startswith("ankle")]
    drawn += PLAIN
    colour = {part: colour_of(part, int(scores[part][frame])) for _, _, part in drawn}
    neck = GREY if np.isnan(angles[INDEX["neck_flexion"]]) else colour["neck"]
    return SkeletonMarkers(
        lines=np.array([(at[a], at[b]) for a, b, _ in drawn]),
        colours=tuple(colour[part] for _, _, part in drawn),
        head=at["head"],
        head_colour=neck,
    )
