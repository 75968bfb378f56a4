"""Trains a small network on recordings of presses at known places, through a torch `Dataset`.

    python train_network.py                                  # records presses on the simulated board first, for a minute
    python train_network.py one.tactomo two.tactomo          # recordings of one's own; the last one is not learned from

Needs torch. Beside each recording `touch.tactomo` is a table `touch.csv` with a press a row, as a robot's program can write it:
`from_sequence`, `to_sequence`, `x_m`, `y_m`: the board's numbers of the first and the last scan of the press, and where it is (m).
"""

import pathlib
import sys
import tempfile

import numpy as np
import tactomo

try:
    from torch.utils.data import Dataset
except ImportError:  # A data loader needs no more of one than its length and its items.
    Dataset = object


class PressDataset(Dataset):
    """Frames of presses in recordings, each with its place: `(features, place_m)`, float32 arrays `(257,)` and `(2,)`.

    The readings, less the baseline, are told by their pattern and the logarithm of their size: one barely changes with the force, the other
    says it. Of a press `frames_each` frames are taken, spread over it.
    """

    def __init__(self, recordings, frames_each=4):
        self.features, self.places_m = [], []
        for path in map(pathlib.Path, recordings):
            self._add(path, frames_each)
        if not self.features:
            raise ValueError("no press of the tables is in the recordings")
        self.features = np.array(self.features, dtype=np.float32)
        self.places_m = np.array(self.places_m, dtype=np.float32)

    def _add(self, path, frames_each):
        table = np.genfromtxt(path.with_suffix(".csv"), delimiter=",", names=True, ndmin=1)
        frames = {frame.sequence: frame.readings for frame in tactomo.Recording(path).less_baseline()}
        sequences = np.array(sorted(frames))
        for press in table:
            within = sequences[(sequences >= press["from_sequence"]) & (sequences <= press["to_sequence"])]
            if not len(within):
                continue
            for index in np.linspace(0, len(within) - 1, min(frames_each, len(within))).astype(int):
                self.features.append(features(frames[within[index]]))
                self.places_m.append([press["x_m"], press["y_m"]])

    def __len__(self):
        return len(self.features)

    def __getitem__(self, index):
        return self.features[index], self.places_m[index]


def features(readings):
    """Pattern and size of a frame: `(257,)`."""
    size = np.linalg.norm(readings) + 1e-9
    return np.append(readings.ravel() / size, np.log(size))


def record(path, count, seed, detector, as_built=None, held_s=0.1):
    """Records presses on the simulated detector, and writes their table."""
    random, rows = np.random.default_rng(seed), []
    options = {"detector": detector, "as_built": as_built, "scene": "rest", "solver": "tikhonov", "seed": seed, "learn": False}
    with tactomo.Live(simulate=True, record=path, **options) as live:
        next(event for event in live if not event.rezeroing)
        for _ in range(count):
            x_m, y_m = random.uniform(-0.022, 0.022, 2)
            live.press([(x_m, y_m, 0.004, 10 ** random.uniform(-3.3, -2.5))])
            begin = stands(live, True)
            end = after(live, begin.time_s + held_s)
            rows.append((begin.sequence, end.sequence, x_m, y_m))
            live.press()
            stands(live, False)
    np.savetxt(path.with_suffix(".csv"), rows, delimiter=",", header="from_sequence,to_sequence,x_m,y_m", comments="")


def stands(live, is_touched):
    """An event some frames after something has begun to touch, or has ceased to: a request takes its time to the board."""
    begin = next(event for event in live if bool(event.contacts) == is_touched)
    return after(live, begin.time_s + 0.02)


def after(live, time_s):
    """The first event after a time of the board (s)."""
    return next(event for event in live if event.time_s > time_s)


def train(dataset, epochs):
    """A network from features to a place (m)."""
    import torch
    from torch.utils.data import DataLoader

    torch.manual_seed(1)
    mean, spread = (torch.tensor(of(dataset.features, axis=0)) for of in (np.mean, np.std))
    network = torch.nn.Sequential(
        torch.nn.Linear(257, 128), torch.nn.GELU(), torch.nn.Linear(128, 128), torch.nn.GELU(), torch.nn.Linear(128, 2)
    )

    def place_m(told):
        return 0.01 * network((told - mean) / (spread + 1e-6))

    optimizer = torch.optim.AdamW(network.parameters(), lr=2e-3, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, epochs)
    for _ in range(epochs):
        for told, known_m in DataLoader(dataset, batch_size=64, shuffle=True):
            optimizer.zero_grad()
            loss = ((place_m(told) - known_m) / 0.01).square().mean()
            loss.backward()
            optimizer.step()
        schedule.step()

    def found_m(told):
        with torch.no_grad():
            return place_m(torch.tensor(told)).numpy()

    return found_m


def main():
    recordings = [pathlib.Path(name) for name in sys.argv[1:]]
    if len(recordings) == 1:
        sys.exit("two recordings are needed: the last one is not learned from")
    with tempfile.TemporaryDirectory() as folder:
        if not recordings:
            recordings = [pathlib.Path(folder) / f"{name}.tactomo" for name in ("learned", "others")]
            for seed, (path, count) in enumerate(zip(recordings, (250, 50), strict=True)):
                print(f"recording {count} presses")
                record(path, count, seed + 1, tactomo.Detector("square-60"), as_built=7)
        *taught, others = recordings
        dataset, unseen = PressDataset(taught), PressDataset([others])
    print(f"{len(dataset)} frames to learn from, {len(unseen)} others")
    found_m = train(dataset, epochs=150)
    for name, known in {"learned from": dataset, "others": unseen}.items():
        error_mm = 1e3 * np.linalg.norm(found_m(known.features) - known.places_m, axis=1)
        print(f"{name:>12}: mean error {error_mm.mean():.2f} mm, 95 % below {np.percentile(error_mm, 95):.2f} mm")


if __name__ == "__main__":
    main()
