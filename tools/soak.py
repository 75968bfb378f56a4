#!/usr/bin/env python3
"""Eight simulated boards for as long as one likes, with whatever may go wrong beside them.

    python3 tools/soak.py target/release/tactomo 3600

Four boards are touched all the time, two now and then, one has an electrode that is open, one rests. A ninth is a serial port that says nonsense and
is unplugged and plugged in again. A reader of the stream takes a line a second, and, where this may mount one, another stream goes to a disk of 1 MB. It
prints a line a minute and exits with 1 if anything is not as it should be. It needs Linux and nothing besides Python.
"""

import json
import os
import pathlib
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tty

# name -> options. The open electrode is found out; healthy ones must never be.
BOARDS = {
    "one": {"scene": "single"},
    "moving": {"scene": "moving"},
    "several": {"scene": "several"},
    "changing": {"scene": "changing-force"},
    "wandering": {"scene": "wandering"},
    "rolling": {"scene": "rolling-ball"},
    "open": {"scene": "wandering", "fault": ["open:3"]},
    "rest": {"scene": "rest"},
}
# Memory that may be gained after the first minutes (MB): a leak of a byte a frame is 12 MB an hour with eight boards.
MOST_GAINED_MB = 12


def body(port: str) -> str:
    """The body's file."""
    patches = [f'[[patch]]\nname = "{name}"\nsimulate = true\nseed = {seed}\n' + "".join(f"{key} = {json.dumps(value)}\n" for key, value in options.items()) for seed, (name, options) in enumerate(BOARDS.items())]
    return "\n".join([*patches, f'[[patch]]\nname = "unplugged"\nport = "{port}"\n'])


def memory_mb(pid: int) -> float:
    """What a process has of memory."""
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


class Nonsense(threading.Thread):
    """A serial port, under a name that stays, that sends random bytes by the million, goes, and comes again."""

    def __init__(self, link: pathlib.Path) -> None:
        super().__init__(daemon=True)
        self.link, self.sent, self.plugged = link, 0, 0
        self.plug()

    def plug(self) -> None:
        self.host, board = os.openpty()
        tty.setraw(board)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(board))
        os.set_blocking(self.host, False)
        self.board, self.plugged = board, self.plugged + 1

    def run(self) -> None:
        while True:
            end = time.monotonic() + 20
            while time.monotonic() < end:
                try:
                    self.sent += os.write(self.host, random.randbytes(4096))
                    os.read(self.host, 4096)
                except BlockingIOError:
                    pass
                except OSError:
                    break
                time.sleep(0.02)
            os.close(self.host)
            os.close(self.board)
            self.link.unlink(missing_ok=True)
            time.sleep(5)
            self.plug()


def slow_reader(port: int) -> None:
    """Takes a line a second."""
    with socket.create_connection(("127.0.0.1", port)) as connection:
        lines = connection.makefile()
        while lines.readline():
            time.sleep(1)


class Checked:
    """What the stream of all says, line by line."""

    def __init__(self) -> None:
        self.times: dict[str, float] = {}
        self.counts: dict[str, int] = {}
        self.touched: dict[str, int] = {}
        self.wrong: list[str] = []

    def take(self, line: str) -> None:
        answer = json.loads(line)
        patch, time_s = answer["patch"], answer["time_s"]
        if time_s < self.times.get(patch, 0.0):
            self.wrong.append(f"{patch}: {time_s} after {self.times[patch]}")
        self.times[patch] = time_s
        self.counts[patch] = self.counts.get(patch, 0) + 1
        self.touched[patch] = self.touched.get(patch, 0) + bool(answer["contacts"])
        out = answer.get("flags", {}).get("excluded", [])
        if [electrode for electrode in out if not (patch == "open" and electrode == 3)]:
            self.wrong.append(f"{patch}: electrodes {out} are left out at {time_s}")
        if patch == "rest" and answer["contacts"]:
            self.wrong.append(f"rest: {len(answer['contacts'])} contacts at {time_s}")
        if answer.get("lost_before"):
            self.wrong.append(f"{patch}: {answer['lost_before']} frames lost at {time_s}")


def main() -> int:
    program, seconds = sys.argv[1], float(sys.argv[2])
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        nonsense = Nonsense(folder / "port")
        (folder / "body.toml").write_text(body(str(nonsense.link)))
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        arguments = ["live", "--body", str(folder / "body.toml"), "--seconds", str(seconds), "--json", "--record", str(folder / "kept"), "--stream", str(folder / "lines"), "--stream", f"tcp:{port}", "--stream-hz", "50"]
        disk = folder / "disk"
        disk.mkdir()
        has_disk = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "soak", str(disk)], capture_output=True).returncode == 0
        if has_disk:
            arguments += ["--stream", str(disk / "lines")]
        run = subprocess.Popen([program, *arguments], stdout=subprocess.PIPE, stderr=open(folder / "errors", "w"), text=True)
        nonsense.start()
        time.sleep(8)
        threading.Thread(target=slow_reader, args=(port,), daemon=True).start()
        checked, begun, first_mb, told = Checked(), time.monotonic(), None, 0.0
        with open(folder / "lines") as lines:
            rest = ""
            while run.poll() is None:
                rest += lines.read()
                *whole, rest = rest.split("\n")
                for line in whole:
                    checked.take(line)
                elapsed = time.monotonic() - begun
                if elapsed - told >= 60:
                    told, now_mb = elapsed, memory_mb(run.pid)
                    first_mb = first_mb if first_mb or elapsed < 170 else now_mb
                    print(f"{elapsed:6.0f} s  {now_mb:6.1f} MB  {sum(checked.counts.values())} lines, {nonsense.sent} bytes of nonsense, plugged in {nonsense.plugged} times, {len(checked.wrong)} wrong", flush=True)
                    if first_mb and now_mb > first_mb + MOST_GAINED_MB:
                        checked.wrong.append(f"memory rose from {first_mb:.1f} to {now_mb:.1f} MB")
                time.sleep(0.2)
        if has_disk:
            subprocess.run(["umount", str(disk)], check=True)
        else:
            print("no disk was full: mounting one needs root")
        summaries = [json.loads(line) for line in run.stdout.read().splitlines()]
        for summary in summaries:
            patch, kept = summary["patch"], folder / "kept" / f"{summary['patch']}.tactomo"
            info = json.loads(subprocess.run([program, "recording", "info", str(kept), "--json"], capture_output=True, text=True, check=True).stdout)
            print(f"{patch:10} {summary['frames']} frames, {summary['frames_per_s']:.0f}/s, {summary['dropped']} lost, {summary['corrupt']} corrupt, age p99 {summary['age_us']['p99'] / 1000:.2f} ms, recording {info['frames']}, touched {checked.touched.get(patch, 0)} of {checked.counts.get(patch, 0)}")
            if summary["dropped"] or summary["corrupt"] or info["frames"] != summary["frames"] or info["is_damaged"]:
                checked.wrong.append(f"{patch}: lost or damaged: {summary} {info['loss']}")
        if sorted(summary["patch"] for summary in summaries) != sorted(BOARDS):
            checked.wrong.append(f"told of {[summary['patch'] for summary in summaries]}")
        for name in checked.counts.keys() - BOARDS.keys():
            checked.wrong.append(f"answers of {name}")
        print((folder / "errors").read_text()[-1500:])
        print("\n".join(checked.wrong[:40]) or "nothing was wrong")
        return int(bool(checked.wrong))


if __name__ == "__main__":
    sys.exit(main())
