"""Small valid inputs of every reader and loader, made by the writers of the package and of its tests."""

from __future__ import annotations

import gzip
import io
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "datasets")]

FRAMES = 4


def shipped(pattern: str) -> list[bytes]:
    """Return the content of files of the package."""
    return [path.read_bytes() for path in sorted(ROOT.glob(pattern))]


def mcap() -> list[bytes]:
    """Joint states packed, stored and without chunks; frames and transforms in CDR, JSON and Protobuf."""
    from tests.support import encode_motion
    from tests.support import mcap_builder as make
    from tests.support.body_motion import PARENTS, BodyMotion

    plan = make.whole(make.payloads()[:FRAMES])
    stored = {"compression": "", "pack": bytes}
    files = [make.build(plan), make.build(make.replace(plan, **stored)), make.build(make.replace(plan, chunked=False))]
    names = tuple(dict.fromkeys(["pelvis", *PARENTS.values(), *PARENTS]))
    rng = np.random.default_rng(0)
    motion = BodyMotion(
        np.arange(FRAMES) / 60.0,
        names,
        np.tile(np.eye(3), (FRAMES, len(names), 1, 1)),
        rng.uniform(0.0, 1.0, (FRAMES, len(names), 3)),
    )
    writers = (
        encode_motion.write_human_urdf,
        encode_motion.write_xsens_tf,
        encode_motion.write_ros4hri,
        encode_motion.write_foxglove_json,
        encode_motion.write_foxglove_protobuf,
    )
    with TemporaryDirectory() as folder:
        for number, write in enumerate(writers):
            path = Path(folder) / f"{number}.mcap"
            write(path, motion)
            files.append(path.read_bytes())
    return files + _copies(("mcap_packed_messages",))


def _copies(names: tuple[str, ...]) -> list[bytes]:
    from tests.support import bag_copies

    files = []
    for name in names:
        with TemporaryDirectory() as folder:
            source = bag_copies.write_motion(Path(folder) / "source.mcap", FRAMES)
            copy = bag_copies.COPIES[name](source, Path(folder))
            files.append(copy.read_bytes() if copy.is_file() else next(copy.glob("a.*")).read_bytes())
    return files


def bags() -> list[bytes]:
    """ROS 1 bags, plain and packed."""
    return _copies(("bag", "bag_bz2", "bag_lz4"))


def databases() -> list[bytes]:
    """rosbag2 databases with and without definitions, and with packed messages."""
    return _copies(("db3", "db3_humble", "db3_packed_messages"))


def definitions() -> list[bytes]:
    """Definitions in IDL."""
    from tests.reba.readers.mcap.test_definitions import EVERYTHING, FILES, JOINED

    return [JOINED.encode(), EVERYTHING.encode(), "\n".join(FILES.values()).encode()]


def _points(profile: str) -> list[str]:
    from reba.readers.recording.profile import find_profile

    known = find_profile(profile)
    return list(dict.fromkeys([*known.names, *known.marks]))


def c3d() -> list[bytes]:
    """Floats and integers, Intel and MIPS, and a body of Plug-in Gait markers."""
    from tests.support.c3d_bytes import DEC, MIPS, c3d_bytes

    xyz = np.arange(36.0).reshape(3, 4, 3) * 20
    body = _points("markers_plug_in_gait")
    places = np.random.default_rng(1).uniform(0.0, 1800.0, (FRAMES, len(body), 3))
    return [
        c3d_bytes(["A", "B", "s:C", "*1"], xyz, texts={"ANGLES": ["B"]}, analogs=2),
        c3d_bytes(["A", "B", "C", "D"], xyz, scale=0.1, processor=MIPS),
        c3d_bytes(["A", "B", "C", "D"], xyz, processor=DEC),
        c3d_bytes(body, places),
    ]


def bvh() -> list[bytes]:
    """Three joints, and a body with the names of MotionBuilder."""
    from tests.reba.readers.formats.test_bvh import SMALL

    names = [name for name in _points("bvh_motionbuilder") if name != "Hips"]
    aside = {"Left": 10, "Righ": -10}
    joints = "".join(
        f"JOINT {name}\n{{\nOFFSET {aside.get(name[:4], 0)} 10 0\nCHANNELS 3 Zrotation Yrotation Xrotation\n"
        "End Site\n{\nOFFSET 0 1 0\n}\n}\n"
        for name in names
    )
    row = " ".join(["5"] * (6 + 3 * len(names)))
    body = (
        "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\n"
        "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n"
        f"{joints}}}\nMOTION\nFrames: {FRAMES}\nFrame Time: 0.02\n" + f"{row}\n" * FRAMES
    )
    return [SMALL.encode(), body.encode()]


def opensim() -> list[bytes]:
    """Three coordinates, and those of a body, in degrees and in radians."""
    from tests.reba.readers.formats.test_opensim import SMALL

    names = _points("opensim")
    row = "\t".join(["5.5"] * len(names))
    head = f"Coordinates\nversion=1\nnRows={FRAMES}\nnColumns={len(names) + 1}\ninDegrees=yes\nendheader\ntime\t"
    body = head + "\t".join(names) + "\n" + "".join(f"{at / 100}\t{row}\n" for at in range(FRAMES))
    return [SMALL.encode(), body.encode(), body.replace("=yes", "=no").encode()]


def trc() -> list[bytes]:
    """Four markers, and the first frames of the recording in `datasets/`."""
    from tests.reba.readers.formats.test_trc import SMALL

    lines = (ROOT / "datasets" / "balancing_keypoints.trc").read_bytes().splitlines(keepends=True)
    return [SMALL.encode(), b"".join(lines[: 6 + FRAMES])]


def mvnx() -> list[bytes]:
    """A body with segments and joint angles."""
    from tests.support.mvnx_text import mvnx_text

    turns = np.tile([1.0, 0, 0, 0], (2, 23, 1))
    return [mvnx_text(turns, np.ones((2, 23, 3)), np.zeros((2, 22, 3)), np.zeros((2, 6, 3))).encode()]


def table() -> list[bytes]:
    """Posture and joint tables and exports of Vicon and Motive."""
    from tests.reba.readers.formats.test_table import SMALL
    from tests.reba.readers.formats.test_vicon import VICON

    lines = (ROOT / "datasets" / "simulated_assembly.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    joints = "time," + ",".join(_points("human_description")) + "\n"
    joints += "".join(f"{at / 10}," + ",".join(["0.1"] * joints.count(",")) + "\n" for at in range(FRAMES))
    return [SMALL.encode(), VICON.encode(), "".join(lines[: 1 + FRAMES]).encode(), joints.encode(), *_motive()]


def _motive() -> list[bytes]:
    """Exports of OptiTrack Motive: bones as quaternions and as Euler angles, and markers."""
    from tests.support.motive_csv import NAMES, motive_csv
    from tests.support.synthetic_bodies import moving_postures
    from tests.support.t_pose_bodies import t_pose_bodies

    bodies = {f"Bob:{NAMES[bone]}": pose for bone, pose in t_pose_bodies(moving_postures()[:FRAMES]).items()}
    points = {label: place for label, (_, place) in bodies.items()}
    return [motive_csv(bodies).encode(), motive_csv(bodies, points, rotation="XYZ", version="1.23").encode()]


def smpl() -> list[bytes]:
    """Poses as AMASS and as the smplx library write them, packed and plain."""
    from tests.support.smpl_poses import Z_UP, smpl_pose
    from tests.support.synthetic_bodies import moving_postures

    pose = smpl_pose(moving_postures()[:FRAMES], Z_UP)
    files = []
    for save in (np.savez, np.savez_compressed):
        for arrays in (
            {"poses": np.concatenate([pose, pose[:, :6]], axis=1), "mocap_framerate": np.array(120.0)},
            {"global_orient": pose[:, :3], "body_pose": pose[:, 3:], "fps": np.array(30), "betas": np.zeros(10)},
        ):
            buffer = io.BytesIO()
            save(buffer, **arrays)
            files.append(buffer.getvalue())
    return files


def xlsx() -> list[bytes]:
    """Workbooks of the small table and of two sheets."""
    files = []
    for sheets in ({"Data": table()[0]}, {"Notes": b"a,b\nmade,today\n", "Angles": table()[2]}):
        buffer = io.BytesIO()
        with pd.ExcelWriter(buffer, engine="openpyxl") as writer:
            for title, data in sheets.items():
                pd.read_csv(io.BytesIO(data), comment="#").to_excel(writer, sheet_name=title, index=False)
        files.append(buffer.getvalue())
    return files


def packed() -> list[bytes]:
    """Tables packed with gzip, one of two members."""
    small, _, shift, *_ = table()
    return [gzip.compress(small, mtime=0), gzip.compress(shift[:99], mtime=0) + gzip.compress(shift[99:], mtime=0)]


def parquet() -> list[bytes]:
    """The tables, packed and plain."""
    files = []
    for packing in ("snappy", None):
        for data in (table()[0], table()[2]):
            buffer = io.BytesIO()
            pd.read_csv(io.BytesIO(data)).to_parquet(buffer, compression=packing, index=False)
            files.append(buffer.getvalue())
    return files


def rules() -> list[bytes]:
    """All presets, and three changed fields."""
    from reba.method.rules import PRESETS

    return [
        *(preset.to_toml().encode() for preset in PRESETS.values()),
        b'preset = "paper"\ntrunk_twist = 5\nedges = "upper"\nseated_knees = true\n',
    ]


def errors() -> list[bytes]:
    """The tables of measurement error, and one of a user."""
    own = b'base = "optical"\ntrunk_twist = 5\n[knee_flexion]\nsd = 2\nbias = 1\n'
    return [*shipped("reba/method/errors/*.toml"), own]


def profiles() -> list[bytes]:
    """All that come with the package."""
    return shipped("reba/readers/recording/profiles/*.toml")


def domains() -> list[bytes]:
    """All that come with `dreba`."""
    return shipped("dreba/domains/*.toml")


def models() -> list[bytes]:
    """A small one of each kind that comes with `dreba`."""
    return [
        (ROOT / "dreba" / "surrogates" / "shipped" / f"{name}.json").read_bytes()
        for name in ("quadratic", "convex", "soft")
    ]


def poses() -> list[bytes]:
    """Poses with and without factors, as `dreba sample` writes them."""
    import dreba

    files = []
    with TemporaryDirectory() as folder:
        for number, domain in enumerate(("human", "paper")):
            path = Path(folder) / f"{number}.parquet"
            dreba.sample(20, domain=domain, rng=number).save(path)
            files.append(path.read_bytes())
    return files


def study() -> list[bytes]:
    """Manifests of studies."""
    return [
        b"file,participant,condition,trial,simulated\na.mcap,p1,with,1,false\nb.mcap,p1,without,1,\n,p2,with,1,\n",
        b"file;participant;condition\na.mcap;p1;with\nb.mcap;p2;without\n",
    ]


def datasets() -> list[bytes]:
    """The manifest of a dataset of scores."""
    line = {
        "recording": "shift.csv", "input": "shift.csv", "size": 120, "modified": 1_700_000_000_000_000_000,
        "hash": "0" * 64, "version": "0.1.0", "rules": {"name": "measured"}, "rules_hash": "1" * 64,
        "options": {"load": 3.0, "coupling": None}, "outcome": "scored", "output": "recording=shift.csv/scores.parquet",
        "seconds": 0.1, "frames": 100, "finished": "2026-01-01T00:00:00+00:00", "summary": {"mean": 3.5},
    }  # fmt: skip
    other = {**line, "recording": "day.csv", "input": "day.csv", "outcome": "failed", "error": "day.csv: damaged"}
    return ["".join(json.dumps(one) + "\n" for one in (line, other, line)).encode()]
