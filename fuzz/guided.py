"""Coverage-guided inputs: atheris (libFuzzer) keeps what reaches new branches and changes it further.

Half of the changes are libFuzzer's own, half the structure-aware ones of the target. Inputs are used and judged as
those of `check.work`, and reported through the same pipe; `run.py --engine atheris` starts it.
"""

from __future__ import annotations

import os
import random
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path

import mutate
from check import check, limit, peak, report
from targets import TARGETS

INSTRUMENTED = ["reba", "dreba", "lgp", "tomllib", "mcap", "pddl"]
"""Packages whose branches guide the search."""


def input_file(folder: Path, name: str, seed: int, number: int) -> Path:
    """Where an input is while it is used, and stays if it is a finding."""
    return folder / f"{name}-{seed}-{number}{Path(TARGETS[name].file).suffix}"


def corpus_folder(folder: Path, name: str, seed: int) -> Path:
    """Where the inputs are that reached new branches; a later run with the same seed goes on from them."""
    return folder / "corpus" / f"{name}-{seed}"


def work(
    folder: Path, lasting: float, name: str, seed: int, numbers: range, memory: int, seconds: float, pipe: Connection
) -> None:
    """Test inputs one after another, lasting at most some seconds; report as `check.work` does."""
    import atheris

    target = TARGETS[name]
    # libFuzzer and libraries in C print messages.
    with open(os.devnull, "w") as null:
        os.dup2(null.fileno(), sys.stderr.fileno())
    with atheris.instrument_imports(include=INSTRUMENTED):
        for data in target.seeds:
            check(target, data)
    corpus = corpus_folder(folder, name, seed)
    corpus.mkdir(parents=True, exist_ok=True)
    for at, data in enumerate(target.seeds):
        (corpus / f"seed-{at}").write_bytes(data)
    before = peak()
    limit(memory)
    left = iter(numbers)
    end = time.monotonic() + lasting

    def use(data: bytes) -> None:
        number = next(left, None)
        if number is None or time.monotonic() > end:
            pipe.send((-1, peak() - before))
            pipe.close()
            os._exit(0)  # libFuzzer has no other end that leaves out its report
        # No seed and number lead to this input again: it is on the disk before it can end the process.
        saved = input_file(folder, name, seed, number)
        saved.write_bytes(data)
        result = report(pipe, number, target, data, seconds)
        if result.outcome != "finding":
            saved.unlink()

    def change(data: bytes, longest: int, draw: int) -> bytes:
        rng = random.Random(draw)
        if data and rng.random() < 0.5:
            try:
                return target.mutation(rng, data, target.seeds)[:longest]
            except Exception:  # they are written for valid inputs, and this one may have lost its structure
                return mutate.mutate_bytes(rng, data, target.seeds)[:longest]
        return atheris.Mutate(data, longest)

    options = [f"-seed={seed + numbers.start + 1}", f"-max_len={mutate.LONGEST}", "-len_control=0"]
    # The parent limits the time, and `limit` the memory, as for all inputs.
    options += ["-timeout=1000000", "-rss_limit_mb=0", "-malloc_limit_mb=0"]
    # Inputs that end the process (crash-...) would else be in the current folder.
    options.append(f"-artifact_prefix={folder}/")
    atheris.Setup([sys.argv[0], *options, str(corpus)], use, custom_mutator=change)
    atheris.Fuzz()
