"""Makes a data set of simulated frames on all workers of a ray cluster; a worker that dies loses nothing.

    python cluster.py dataset --frames 1000000              # on this machine, a worker for each core
    python cluster.py dataset --address auto                # on a cluster that runs: see `ray start`
    python cluster.py dataset --kill                        # kills a worker in the middle, to see what comes of it

Needs ray. The folder, which all machines of a cluster must see, gets a file of 1000 frames for each chunk, `frames-000007.npz`:
`readings_v` (frames, 16, 16), `contacts` (frames, 3, 4) with `x_m`, `y_m`, `radius_m` and `conductance_s`, NaN where fewer touch, and
`built`, the seed of the detector that was simulated. A chunk's number says all that is in it, whoever makes it: whatever is missing is made
by calling this again.

On two cores of a machine that was busy with builds, two workers made 1.58 and 1.62 times as many frames a second as one process, and 1.76 times
with one killed in the middle (40 000 frames each, the start of the workers in it; ray 2.60). All 40 files were there and had what one process
makes. That is with `RAY_worker_niceness=0`: ray runs its workers with a niceness of 15, and beside the builds they made 1.08 and 0.55 times as many.
"""

import argparse
import os
import pathlib
import signal
import sys
import time

import numpy as np
import ray
import tactomo

MOST = 3
"""Contacts of a frame."""
DESCRIBED = "square-60"


def contacts(random):
    """Up to three contacts anywhere, from light to firm: `(contacts, 4)`."""
    count = random.integers(MOST + 1)
    places_m, radii_m = random.uniform(-0.026, 0.026, (count, 2)), random.uniform(0.001, 0.006, count)
    return np.column_stack([places_m, radii_m, 10 ** random.uniform(-4, -2.5, count)])


def chunk(number, frames):
    """The arrays of a chunk, each of another detector as built."""
    random = np.random.default_rng(number)
    board = tactomo.Simulator(tactomo.Detector(DESCRIBED).as_built(number), seed=number)
    touches = [contacts(random) for _ in range(frames)]
    padded = np.full((frames, MOST, 4), np.nan)
    for row, touch in zip(padded, touches, strict=True):
        row[: len(touch)] = touch
    readings_v = np.array([board.readings(touch) for touch in touches], dtype=np.float32)
    return {"readings_v": readings_v, "contacts": padded, "built": number}


def file_of(folder, number):
    """The file of a chunk."""
    return pathlib.Path(folder) / f"frames-{number:06}.npz"


def write(folder, number, frames):
    """Makes a chunk's file. Half a file is never there under its name: who is killed leaves one that nobody reads."""
    path = file_of(folder, number)
    if not path.exists():
        unfinished = path.with_suffix(f".{os.getpid()}.part")
        with unfinished.open("wb") as file:
            np.savez(file, **chunk(number, frames))
        unfinished.replace(path)
    return number, os.getpid()


def kill(pid):
    """Ends a worker as a machine that loses its power does."""
    print(f"killing worker {pid}")
    os.kill(pid, signal.SIGKILL)


def make(folder, chunks, frames, kills):
    """Has all chunks made; ray gives what a dead worker had begun to another one."""
    remote = ray.remote(max_retries=-1)(write)
    waiting, done = [remote.remote(str(folder), number, frames) for number in range(chunks)], 0
    while waiting:
        finished, waiting = ray.wait(waiting)
        for number, pid in ray.get(finished):
            done += 1
            print(f"{done} of {chunks} chunks, the newest {number} by worker {pid}")
        if kills and done >= chunks // 3:
            kill(pid)
            kills = False


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--chunk", type=int, default=1000, help="frames of a file")
    parser.add_argument("--workers", type=int, help="on this machine; as many as cores unless given")
    parser.add_argument("--address", help="of a cluster that runs")
    parser.add_argument("--kill", action="store_true", help="kills a worker in the middle")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    chunks = -(-args.frames // args.chunk)
    begin = time.perf_counter()
    one = [chunk(number, args.chunk) for number in range(4)]
    alone_per_s = len(one) * args.chunk / (time.perf_counter() - begin)
    ray.init(address=args.address, num_cpus=args.workers, include_dashboard=False, log_to_driver=False)
    begin = time.perf_counter()
    make(args.folder.resolve(), chunks, args.chunk, args.kill)
    took_s = time.perf_counter() - begin
    missing = [number for number in range(chunks) if not file_of(args.folder, number).exists()]
    if missing:
        sys.exit(f"chunks are missing: {missing}")
    with np.load(file_of(args.folder, 0)) as written:
        if not all(np.array_equal(written[name], one[0][name], equal_nan=True) for name in one[0]):
            sys.exit(f"{file_of(args.folder, 0)} is not the chunk that is made here: it is of another --chunk or version")
    total = chunks * args.chunk
    per_s = total / took_s
    print(
        f"{total} frames in {took_s:.1f} s, {per_s:.0f} a second, {per_s / alone_per_s:.2f} times as many as "
        f"one process with {alone_per_s:.0f}"
    )


if __name__ == "__main__":
    main()
