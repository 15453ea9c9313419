"""Vicon exports: trajectories, their damage, and agreement with the C3D file of a trial."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reba.errors import ReadError
from reba.readers.formats.table import open_table
from reba.readers.recording.stream import Recording
from tests.support.paths import RECORDINGS
from tests.support.says import says


def opened(folder: Path, text: str) -> Recording:
    path = folder / "small.csv"
    path.write_text(text)
    return open_table(path)


VICON = """Trajectories,,,,,,,
100,,,,,,,
,,ann:HEAD,,,box:A,,
Frame,Sub Frame,X,Y,Z,X,Y,Z
,,mm,mm,mm,mm,mm,mm
11,0,100,200,300,1,2,3
12,0,101,,301,4,5,6
"""


def test_vicon_trajectories(tmp_path: Path) -> None:
    devices = "Devices\n1000\n,,Force\nFrame,Sub Frame,Fx\n,,N\n1,0,5\n\n"
    for text in (VICON, VICON.replace("\n", "\r\n"), devices + VICON, VICON + "\n" + devices, "\ufeff" + VICON):
        recording = opened(tmp_path, text)
        assert [(stream.name, stream.kind, stream.names) for stream in recording.streams] == [
            ("ann", "points", ("HEAD",)),
            ("box", "points", ("A",)),
        ]
        (block,) = recording.streams[0].blocks()
        np.testing.assert_allclose(block.time, [0.10, 0.11])
        np.testing.assert_allclose(block.values[:, 0], [[0.1, 0.2, 0.3], [np.nan] * 3])


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("Trajectories", "Devices", "without its section 'Trajectories'"),
        ("100,,,,,,,\n", "-1,,,,,,,\n", "line 2: expected the rate in Hz"),
        ("mm,mm,mm,mm", "mm,m,mm,mm", "line 5 has 2 units"),
        ("mm", "ell", "line 5: unit 'ell' is unknown"),
        ("X,Y,Z,X", "X,Z,Y,X", "expected Frame, Sub Frame, then X, Y, Z"),
        ("101", "1o1", "line 7: '1o1' is not a number"),
        (VICON[VICON.index("Frame") :], "", "line 1 | section"),
    ],
)
def test_damaged_vicon_exports(tmp_path: Path, old: str, new: str, what: str) -> None:
    with pytest.raises(ReadError) as caught:
        opened(tmp_path, VICON.replace(old, new))
    says(caught, *what.split(" | "))


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the real recordings are not beside the checkout")
def test_real_vicon_export_agrees_with_the_c3d_of_the_trial() -> None:
    from reba.readers.formats.c3d import open_c3d

    folder = RECORDINGS / "irsst_box_lift"
    for ours, theirs in zip(
        open_table(folder / "markers.csv").streams, open_c3d(folder / "markers_analogs.c3d").streams, strict=True
    ):
        assert (ours.name, ours.names, ours.count) == (theirs.name, theirs.names, theirs.count)
        for block, other in zip(ours.blocks(), theirs.blocks(), strict=True):
            np.testing.assert_allclose(block.time, other.time, atol=1e-12)
            # The export rounds to 6 digits of millimetres.
            np.testing.assert_allclose(block.values, other.values, atol=1e-5)
