"""Trains scikit-learn on presses at known places, and compares it with the solvers, on a sensor that nobody calibrated.

    python train_on_presses.py

Needs scikit-learn. The presses are simulated; with a robot, `readings` are frames of `tactomo.Live` or `tactomo.Recording.less_baseline()`.
"""

import numpy as np
import tactomo
from sklearn.kernel_ridge import KernelRidge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler


def pressed(board, count, seed):
    """Readings `(count, 256)` (V) of single presses, and their places `(count, 2)` (m)."""
    random = np.random.default_rng(seed)
    places_m = random.uniform(-0.024, 0.024, (count, 2))
    conductances_s = 10 ** random.uniform(-3.5, -2.5, count)
    presses = zip(places_m, conductances_s, strict=True)
    readings = [board.readings([(x_m, y_m, 0.004, conductance_s)]) for (x_m, y_m), conductance_s in presses]
    return np.array(readings), places_m


described = tactomo.Detector("square-60")
# The detector as built: parameters are chosen on the first presses, errors told of others.
board = tactomo.Simulator(described.as_built(seed=11), seed=11)
readings, places_m = pressed(board, 600, seed=1)
others, their_places_m = pressed(board, 100, seed=2)


def features(readings):
    """The pattern of a frame, whatever its strength, and the strength."""
    flat = readings.reshape(len(readings), -1)
    strength = np.linalg.norm(flat, axis=1, keepdims=True)
    return np.hstack([flat / strength, np.log(strength)])


grid = {"kernelridge__gamma": [1e-6, 1e-5, 1e-4, 1e-3], "kernelridge__alpha": [1e-9, 1e-7, 1e-5, 1e-3]}
learner = GridSearchCV(make_pipeline(StandardScaler(), KernelRidge(kernel="rbf")), grid, cv=3)
learner.fit(features(readings), places_m * 1e3)
print("chosen:", learner.best_params_)

errors_mm = {"scikit-learn": np.linalg.norm(learner.predict(features(others)) - their_places_m * 1e3, axis=1)}
for name in ("tikhonov", "contacts"):
    solver, found_mm = tactomo.Solver(name, described), []
    for frame in others:
        solver.reset()
        contacts = solver.solve(frame).array
        firmest = contacts[contacts["conductance_s"].argmax()] if len(contacts) else {"x_m": np.nan, "y_m": np.nan}
        found_mm.append([firmest["x_m"] * 1e3, firmest["y_m"] * 1e3])
    errors_mm[name] = np.linalg.norm(found_mm - their_places_m * 1e3, axis=1)
for name, error_mm in errors_mm.items():
    print(f"{name:>14}: mean error {np.nanmean(error_mm):.2f} mm, found in {np.isfinite(error_mm).mean():.0%} of presses")
