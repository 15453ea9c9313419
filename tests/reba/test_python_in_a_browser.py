"""`reba` without threads, processes, file locks and timers, and without scikit-learn and Pinocchio: a browser's Python.

Recordings of each kind of file are scored in a process from which these are taken away, and in this one.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import reba
from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fuzz"))

import seeds

SCORE = """
import json, os, signal, sys, threading

GONE = {"fcntl", "resource", "termios", "_multiprocessing", "sklearn", "pinocchio", "qpsolvers", "dask", "distributed"}


class Gone:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in GONE:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def refuse(*_, **__):
    raise RuntimeError("not in a browser")


sys.meta_path.insert(0, Gone())
threading.Thread.start = os.fork = os.posix_spawn = refuse
del signal.setitimer, signal.pthread_sigmask

import reba

for path in sys.argv[1:]:
    scores = reba.score(reba.read(path))
    reba.write_report(scores, path + ".html")
    print(json.dumps(scores.data["reba_high"].tolist()))
"""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("recordings")
    bodies = {"body.c3d": seeds.c3d()[-1], "body.bvh": seeds.bvh()[-1]}
    for name, content in bodies.items():
        (folder / name).write_bytes(content)
    shipped = ("simulated_palletising.mcap", "balancing_keypoints.trc", "simulated_assembly.csv")
    for name in shipped:
        (folder / name).write_bytes((ROOT / "datasets" / name).read_bytes())
    return [folder / name for name in (*shipped, *bodies)]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_recordings_are_scored_and_reported_as_elsewhere(recordings: list[Path]) -> None:
    command = [sys.executable, "-W", "ignore", "-c", SCORE, *map(str, recordings)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    for path, line in zip(recordings, done.stdout.splitlines(), strict=True):
        expected = np.asarray(reba.score(reba.read(path)).data["reba_high"])
        np.testing.assert_array_equal(
            np.array(json.loads(line), dtype=float), expected.astype(float), err_msg=path.name
        )
        assert Path(f"{path}.html").stat().st_size > 10_000
