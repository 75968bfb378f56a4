"""Presses on five real sensors, as `tactomo-lab learn` and `tools/compare_sklearn.py` read them.

They come with D. Hardman and others, "Variable Sensitivity Multimaterial Robotic E-Skins using Electrical Impedance Tomography", in the folder `Data` of
https://github.com/DSHardman/Variable-Sensitivity-E-Skins, and stay there: the repository names no licence. Each is a disc of some 80 mm, without or with
a pattern of a second material, that a robot pressed in 2500 random places: 192 readings less the baseline, in units of their own, and the robot's place (m).

    python3 tools/real_sensors.py Data FOLDER SEED

writes `KIND-SEED-taught.npz` with 2000 of the presses, drawn by SEED, and `KIND-SEED-unseen.npz` with the other 500.
"""

import pathlib
import sys

import numpy as np

SENSORS = {
    "plain": ("No Pattern", "noPattern"),
    "parallel": ("Parallel Lines", "parallel"),
    "concentric": ("Concentric Circles", "concentric"),
    "radial": ("Radial", "radial"),
    "full": ("Full CB", "fullCB"),
}
TAUGHT = 2000


def table(path):
    # Their files begin with a byte order mark.
    return np.loadtxt(path, delimiter=",", encoding="utf-8-sig")


def main():
    if len(sys.argv) != 4:
        sys.exit("needed: the folder Data of Variable-Sensitivity-E-Skins, a folder for what is written, and a seed")
    data, folder, seed = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), int(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    for kind, (inside, name) in SENSORS.items():
        readings, places = (table(data / inside / f"{part}_{name}.csv") for part in ("inp", "out"))
        order = np.random.default_rng(seed).permutation(len(readings))
        for part, rows in (("taught", order[:TAUGHT]), ("unseen", order[TAUGHT:])):
            x_m, y_m, z_m = places[rows].T
            np.savez(folder / f"{kind}-{seed}-{part}.npz", readings_v=readings[rows], x_m=x_m, y_m=y_m, z_m=z_m)


if __name__ == "__main__":
    main()
