"""Makes a LeRobot data set of touch beside a camera's pictures: with each picture, the newest touch before it was taken.

    tactomo live --record touch.tactomo                                   # or a folder, of several detectors
    tactomo export touch.tactomo --to jsonl --out touch.jsonl             # or the folder
    python lerobot_dataset.py touch.jsonl pictures dataset --fps 30 --task "hold the cup"

`pictures` has a file for each picture of one camera, named by when it was taken, in nanoseconds since 1970 by the clock of the machine that
recorded the touch: `1795356721248139204.png`. Needs lerobot. Of a detector by the name `thumb` (one that is alone is `touch`), the data set has

    observation.tactile.thumb.points    (6, 6) float32    a row each contact, the strongest first, zeros where fewer touch:
                                                          x, y, z (m), and the force on the detector along them (N)
    observation.tactile.thumb.wrench    (6,) float32      the force of all together (N), and its torque about the middle (N m)
    observation.tactile.thumb.count     (1,) int64        how many contacts touch
    observation.tactile.thumb.age_s     (1,) float32      how much older than the picture the touch is

Where newtons are not known, there is no wrench, and points are (6, 4): x, y, z and the conductance (S) of the contact.
Actions and the state of a robot are not in it: add them to the features and to each frame.
"""

import argparse
import bisect
import json
import pathlib

import numpy as np

POINTS = 6
"""Contacts of a detector that have room in a frame; of more, the strongest."""
WRENCH = ["fx_n", "fy_n", "fz_n", "tx_n_m", "ty_n_m", "tz_n_m"]
CAMERA = "observation.images.camera"


def when_ns(line):
    """When the touch of a line was: its scan, or, where that is not known, when it came."""
    return line.get("host_time_ns") or round(line["arrived_unix_s"] * 1e9)


class Touch:
    """The touch of one detector, from its lines of `--stream` or of an export."""

    def __init__(self, name, lines):
        self.name, self.lines = name, sorted(lines, key=when_ns)
        self.times_ns = [when_ns(line) for line in self.lines]
        contacts = [contact for line in self.lines for contact in line["contacts"]]
        if any(contact.get("z_m") for contact in contacts):
            raise ValueError(f"{name} is curved: which way its contacts push is not in a line")
        self.has_newtons = bool(contacts) and all("force_n" in contact for contact in contacts)
        self.width = 6 if self.has_newtons else 4

    def features(self):
        """What a frame has of it, as LeRobot describes features."""
        described = {
            "points": {"dtype": "float32", "shape": (POINTS, self.width), "names": ["contact", "value"]},
            "count": {"dtype": "int64", "shape": (1,), "names": ["contacts"]},
            "age_s": {"dtype": "float32", "shape": (1,), "names": ["seconds"]},
        }
        if self.has_newtons:
            described["wrench"] = {"dtype": "float32", "shape": (6,), "names": WRENCH}
        return {f"observation.tactile.{self.name}.{what}": feature for what, feature in described.items()}

    def at(self, time_ns):
        """A frame at a time (ns since 1970): the newest touch that is not after it."""
        index = bisect.bisect_right(self.times_ns, time_ns) - 1
        if index < 0:
            raise ValueError(f"{self.name}: the first touch is {(self.times_ns[0] - time_ns) / 1e9:.3f} s after a picture")
        contacts, age_s = self.lines[index]["contacts"], (time_ns - self.times_ns[index]) / 1e9
        rows = np.array([self.row(contact) for contact in contacts]).reshape(len(contacts), self.width)
        strongest = rows[np.argsort(-np.abs(rows[:, -1]), kind="stable")][:POINTS]
        points = np.zeros((POINTS, self.width), np.float32)
        points[: len(strongest)] = strongest
        values = {"points": points, "count": np.array([len(contacts)]), "age_s": np.array([age_s], np.float32)}
        if self.has_newtons:
            torques_n_m = np.cross(rows[:, :3], rows[:, 3:])
            values["wrench"] = np.hstack([rows[:, 3:].sum(axis=0), torques_n_m.sum(axis=0)]).astype(np.float32)
        return {f"observation.tactile.{self.name}.{what}": value for what, value in values.items()}

    def row(self, contact):
        """A contact's place and force, straight into the foam, or its conductance: what presses is not felt sideways."""
        place_m = [contact["x_m"], contact["y_m"], 0.0]
        if self.has_newtons:
            return [*place_m, 0.0, 0.0, -contact["force_n"]]
        return [*place_m, contact.get("conductance_s", 0.0)]


def touches(path):
    """All detectors of a file of lines."""
    lines = {}
    with open(path) as file:
        for text in file:
            line = json.loads(text)
            if not line.get("rezeroing"):
                lines.setdefault(line.get("patch", "touch"), []).append(line)
    if not lines:
        raise ValueError(f"{path} has no touch")
    return [Touch(name, of) for name, of in sorted(lines.items())]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("touch", type=pathlib.Path, help="lines of touch")
    parser.add_argument("pictures", type=pathlib.Path, help="folder of pictures, named by their times")
    parser.add_argument("dataset", type=pathlib.Path, help="folder to make")
    parser.add_argument("--fps", type=int, required=True, help="pictures a second")
    parser.add_argument("--task", default="touch", help="what is done, in words")
    args = parser.parse_args()

    from lerobot.datasets.lerobot_dataset import LeRobotDataset
    from PIL import Image

    detectors = touches(args.touch)
    pictures = sorted(args.pictures.glob("*.png"), key=lambda path: int(path.stem))
    if not pictures:
        raise SystemExit(f"{args.pictures} has no pictures")
    shape = np.asarray(Image.open(pictures[0]).convert("RGB")).shape
    features = {CAMERA: {"dtype": "video", "shape": shape, "names": ["height", "width", "channels"]}}
    for touch in detectors:
        features |= touch.features()
    dataset = LeRobotDataset.create(f"local/{args.dataset.name}", args.fps, features, root=args.dataset)
    for path in pictures:
        frame = {CAMERA: np.asarray(Image.open(path).convert("RGB")), "task": args.task}
        for touch in detectors:
            frame |= touch.at(int(path.stem))
        dataset.add_frame(frame)
    dataset.save_episode()
    dataset.finalize()
    print(f"{len(pictures)} frames of {', '.join(touch.name for touch in detectors)} in {args.dataset}")


if __name__ == "__main__":
    main()
