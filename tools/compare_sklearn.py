"""Sets `tactomo-lab learn` against scikit-learn's KernelRidge, on the same presses of made-up and of real sensors.

The presses are those that the example `sensors` makes up (six kinds, 1800 taught, 400 unseen), or those of `tools/real_sensors.py` (five, 2000 taught, 500
unseen): all pairs `KIND-SEED-taught.npz`, `KIND-SEED-unseen.npz` in a folder. KernelRidge has a Gaussian kernel, whose width and ridge are searched
by cross-validation in three folds (least squares over x, y and z in metres), on each of two descriptions: the standardised channels,
as one would begin with, and the direction and the logarithm of the size of the readings. `tactomo` chooses between the same two. All are judged
by the mean distance on the unseen presses. A second table says how many readings `tactomo` flags that no press can give.

    python3 -m venv .venv && .venv/bin/pip install numpy scikit-learn
    cargo build --release --package tactomo-lab
    cargo run --release --package tactomo-lab --example sensors -- sensors 2
    .venv/bin/python tools/compare_sklearn.py sensors 2 [target/release/tactomo-lab]
"""

import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

# One core for everybody; before NumPy is there.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import numpy as np  # noqa: E402
from sklearn.kernel_ridge import KernelRidge  # noqa: E402
from sklearn.model_selection import GridSearchCV  # noqa: E402
from sklearn.pipeline import make_pipeline  # noqa: E402
from sklearn.preprocessing import FunctionTransformer, StandardScaler  # noqa: E402

# Shares of the inverse mean square distance: widths from 0.2 to 6 of the root of that.
GAMMAS = np.logspace(-1.5, 1.5, 7)
ALPHAS = np.logspace(-6, -1, 6)
FOLDS = 3


def kinds(folder, seed):
    end = f"-{seed}-taught.npz"
    return [path.name.removesuffix(end) for path in sorted(folder.glob(f"*{end}"))]


def presses(folder, kind, seed, part):
    arrays = np.load(folder / f"{kind}-{seed}-{part}.npz")
    return arrays["readings_v"], np.column_stack([arrays["x_m"], arrays["y_m"], arrays["z_m"]])


def directions(readings):
    sizes = np.linalg.norm(readings, axis=1, keepdims=True)
    return np.hstack([readings / sizes, 0.02 * np.log(sizes)])


def searched(description, readings, places):
    """KernelRidge with the width and the ridge that are best in cross-validation, its error there, and what scales its input."""
    scaler = make_pipeline(description).fit(readings)
    described = scaler.transform(readings)
    gamma = 0.5 / np.mean(np.var(described, axis=0).sum())
    search = GridSearchCV(
        KernelRidge(kernel="rbf"),
        {"gamma": gamma * GAMMAS, "alpha": ALPHAS},
        cv=FOLDS,
        scoring="neg_mean_squared_error",
    )
    centre = places.mean(axis=0)
    search.fit(described, places - centre)
    return -search.best_score_, lambda unseen: search.predict(scaler.transform(unseen)) + centre


def sklearn_mm(taught, unseen):
    begin = time.process_time()
    descriptions = {"channels": StandardScaler(), "directions": FunctionTransformer(directions)}
    errors, best = {}, None
    for name, description in descriptions.items():
        score, predict = searched(description, *taught)
        off = np.linalg.norm(predict(unseen[0]) - unseen[1], axis=1)
        errors[name] = 1e3 * np.mean(off)
        best = min(best or (score, name), (score, name))
    return errors, best[1], time.process_time() - begin


def tactomo_mm(program, folder, kind, seed):
    with tempfile.TemporaryDirectory() as temporary:
        model = pathlib.Path(temporary) / "model.safetensors"

        def run(*words):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            done = subprocess.run([program, *map(str, words), "--json"], check=True, capture_output=True, text=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            return json.loads(done.stdout), after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

        learned, cpu_s = run("learn", folder / f"{kind}-{seed}-taught.npz", "--out", model)
        scored, _ = run("score", model, folder / f"{kind}-{seed}-unseen.npz")
    return learned, scored, cpu_s


def unlike_presses(taught, unseen, places, random):
    """Readings that were never taught, by what is wrong with them."""
    count, channels = unseen.shape
    rows = np.arange(count)

    def with_value(columns, value):
        changed = unseen.copy()
        changed[rows, columns] = value
        return changed

    other = random.permutation(count)
    is_apart = np.linalg.norm(places - places[other], axis=1) > 0.02
    loud = np.argsort(-np.abs(unseen), axis=1)[rows, random.integers(10, size=count)]
    return {
        "single presses": unseen,
        "noise": random.normal(size=unseen.shape) * unseen.std(),
        "channels permuted": unseen[:, random.permutation(channels)],
        "a channel at its rail": with_value(random.integers(channels, size=count), np.abs(taught).max()),
        "one of the ten loudest dead": with_value(loud, 0.0),
        "two presses, 2 cm apart": (unseen + unseen[other])[is_apart],
    }


def flagged(program, folder, seed):
    shares = {}
    for kind in kinds(folder, seed):
        taught, _ = presses(folder, kind, seed, "taught")
        unseen, places = presses(folder, kind, seed, "unseen")
        with tempfile.TemporaryDirectory() as temporary:
            model, table = pathlib.Path(temporary) / "model.safetensors", pathlib.Path(temporary) / "readings.npz"
            words = [program, "learn", str(folder / f"{kind}-{seed}-taught.npz"), "--out", str(model)]
            subprocess.run(words, check=True, capture_output=True)
            for name, readings in unlike_presses(taught, unseen, places, np.random.default_rng(int(seed))).items():
                x_m, y_m, z_m = places[: len(readings)].T
                np.savez(table, readings_v=readings, x_m=x_m, y_m=y_m, z_m=z_m)
                done = subprocess.run([program, "score", str(model), str(table), "--json"], check=True, capture_output=True)
                scored = json.loads(done.stdout)
                shares.setdefault(name, []).append(100 * scored["flagged"] / scored["presses"])
    print("\n| flagged, % | " + " | ".join(f"`{kind}`" for kind in kinds(folder, seed)) + " |")
    print("|---" * (len(kinds(folder, seed)) + 1) + "|")
    for name, of_kinds in shares.items():
        print(f"| {name} | " + " | ".join(f"{share:.1f}" for share in of_kinds) + " |")


def main():
    folder, seed = pathlib.Path(sys.argv[1]), sys.argv[2]
    program = sys.argv[3] if len(sys.argv) > 3 else "target/release/tactomo-lab"
    print("| sensor | channels | KernelRidge: channels | directions | its search | tactomo | described by | dimensions | fit | a press | flagged |")
    print("|---" * 11 + "|")
    for kind in kinds(folder, seed):
        taught, unseen = (presses(folder, kind, seed, part) for part in ("taught", "unseen"))
        errors, best, sklearn_s = sklearn_mm(taught, unseen)
        learned, scored, cpu_s = tactomo_mm(program, folder, kind, seed)
        texts = [f"{'**' if name == best else ''}{errors[name]:.2f} mm{'**' if name == best else ''}" for name in errors]
        print(
            f"| `{kind}` | {learned['channels']} | {texts[0]} | {texts[1]} | {sklearn_s:.0f} s | {1e3 * scored['mean_m']:.2f} mm "
            f"| {learned['description']} | {learned['components']} | {cpu_s:.1f} s | {scored['press_us']:.0f} us | {scored['flagged']} of {scored['presses']} |",
            flush=True,
        )
    flagged(program, folder, seed)


if __name__ == "__main__":
    main()
