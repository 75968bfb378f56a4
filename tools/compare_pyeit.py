"""Sets the linear image of tactomo against pyEIT's one-step solver, in CPU seconds on one thread each.

Both have 16 electrodes and about the same number of unknowns: values on elements for pyEIT, on nodes for tactomo. pyEIT: its own mesh of a
disc, Jacobian and one-step Gauss-Newton with the NOSER prior (jac.JAC, "kotre"), adjacent driving, 208 readings. tactomo: the thin shell of
square-60, mesh and Jacobian included, Tikhonov's image of 256 readings.

Three things are compared, each as it comes and bare:

- A frame as users get it: pyEIT's `solve` gives an image, tactomo's the image, its residual, flags and the contacts in it.
- The matrix product alone. pyEIT's is elements x readings in double precision: 3 MB, more than the nearer caches of many processors hold, so that its
  time depends on them; in single precision, which pyEIT does not use, it is told beside. Readings of one grounded electrode have no more dimensions
  than electrodes, so tactomo's is two small ones in single precision: electrodes x readings, and nodes x electrodes. The same two are timed in
  NumPy as well: what is left of the difference then is the language's, not the algebra's.
- Set-up. As it comes, pyEIT's solver inverts a matrix of elements x elements. The same matrix is algebraically equal to one made from an
  inverse of readings x readings, H = W^-1 J' (J W^-1 J' + l^2)^-1 with the diagonal prior W (the matrix inversion lemma), which pyEIT does not
  use; that is checked here to rounding and timed too: what an algorithm costs that is as good as it can be. pyEIT's mesh stands apart.

Both take turns in ROUNDS rounds, and medians are told. Times are those of the processor (`time.process_time`, and the same clock of the
thread in the example `speed`), so that other load counts for little.

    python3 -m venv .venv && .venv/bin/pip install pyeit==1.2.4
    .venv/bin/python tools/compare_pyeit.py [SIZE [PROGRAM]]

SIZE is pyEIT's mesh size (0.06 makes about 1900 elements), PROGRAM the example `speed` where it is built already.
"""

import json
import os
import subprocess
import sys
import time

# One thread for everybody; before NumPy is there.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import numpy as np  # noqa: E402
import pyeit.eit.jac as jac  # noqa: E402
import pyeit.eit.protocol as protocol  # noqa: E402
import pyeit.mesh as mesh  # noqa: E402

ROUNDS = 9
FRAMES = 400
ELECTRODES = 16
POWER, LAMBDA = 0.5, 0.01


def cpu_s(of):
    """What `of` gives, and the CPU time (s) that it took."""
    begin = time.process_time()
    given = of()
    return given, time.process_time() - begin


def pyeit_solver(disc):
    return jac.JAC(disc, protocol.create(16, dist_exc=1, step_meas=1, parser_meas="std"))


def as_it_comes(solver):
    solver.setup(p=POWER, lamb=LAMBDA, method="kotre", perm=1, jac_normalized=True)
    return solver.H


def by_readings(jacobian):
    """The same matrix from an inverse of readings x readings."""
    weights = np.einsum("ij,ij->j", jacobian, jacobian) ** POWER
    over = jacobian.T / weights[:, None]
    return over @ np.linalg.inv(jacobian @ over + LAMBDA * np.eye(len(jacobian)))


def each_us(of):
    """Time (us) of each of many calls."""
    _, taken_s = cpu_s(lambda: [of() for _ in range(FRAMES)])
    return taken_s / FRAMES * 1e6


def pyeit_frames_us(solver):
    """`solve`, as users call it, and the matrix product in it alone, also in single precision."""
    rest = np.linspace(0.5, 1.0, solver.H.shape[1])
    pressed = rest * 1.01
    change = (pressed - rest) / rest
    single, single_change = solver.H.astype(np.float32), change.astype(np.float32)
    return {
        "frame": each_us(lambda: solver.solve(pressed, rest, normalize=True)),
        "product": each_us(lambda: solver.H @ change),
        "single": each_us(lambda: single @ single_change),
    }


def small_product_us(nodes):
    """tactomo's two products in NumPy."""
    random = np.random.default_rng(1)
    shapes = [(nodes, ELECTRODES), (ELECTRODES, ELECTRODES**2), (ELECTRODES**2,)]
    to_image, to_coefficients, readings = (random.normal(size=shape).astype(np.float32) for shape in shapes)
    return each_us(lambda: to_image @ (to_coefficients @ readings))


def pyeit_set_ups_s(disc):
    """The solver, and set-up times (s): as it comes, and from an inverse of readings x readings."""
    solver, made_s = cpu_s(lambda: pyeit_solver(disc))
    matrix, usual_s = cpu_s(lambda: as_it_comes(solver))
    jacobian, jacobian_s = cpu_s(lambda: solver.fwd.compute_jac(normalize=True)[0])
    equal, equal_s = cpu_s(lambda: by_readings(jacobian))
    off = np.abs(np.abs(equal) - np.abs(matrix)).max() / np.abs(matrix).max()
    assert off < 1e-6, f"the two forms differ by {off}"
    return solver, {"usual": made_s + usual_s, "equal": made_s + jacobian_s + equal_s}


def tactomo(nodes):
    run = ["cargo", "run", "--release", "--quiet", "--package", "tactomo-lab", "--example", "speed", "--"]
    command = sys.argv[2:3] or run
    return json.loads(subprocess.run([*command, str(nodes)], check=True, capture_output=True, text=True).stdout)


def figure(value):
    return f"{value:.1f}" if value < 20 else f"{value:.0f}"


def row(name, theirs, ours, unit):
    texts = [figure(quartile) for quartile in np.quantile(theirs / ours, [0.5, 0.25, 0.75])]
    print(f"| {name} | {figure(np.median(theirs))} {unit} | {figure(np.median(ours))} {unit} | {texts[0]} ({texts[1]} to {texts[2]}) |")


def main():
    size = float(sys.argv[1]) if len(sys.argv) > 1 else 0.06
    disc, mesh_s = cpu_s(lambda: mesh.create(ELECTRODES, h0=size))
    elements = len(disc.element)
    # Built once, before anything is timed; a mesh has somewhat other nodes than it is asked for.
    nodes = round(elements * elements / tactomo(elements)["nodes"])
    rounds = []
    for _ in range(ROUNDS):
        solver, set_ups_s = pyeit_set_ups_s(disc)
        ours = tactomo(nodes)
        rounds.append({**set_ups_s, **pyeit_frames_us(solver), "small": small_product_us(ours["nodes"]), **ours})
    of = {name: np.array([one[name] for one in rounds]) for name in rounds[0]}
    print(f"{elements} elements, {ours['nodes']} nodes; medians of {ROUNDS} rounds, of ratios with their quartiles\n")
    print("| CPU time on one thread | pyEIT | tactomo | ratio |\n|---|---|---|---|")
    row("a frame as users get it", of["frame"], of["frame_us"], "us")
    row("the matrix product alone", of["product"], of["image_us"], "us")
    row("the same, NumPy in single precision", of["single"], of["image_us"], "us")
    row("that against a frame as users get it", of["single"], of["frame_us"], "us")
    row("tactomo's two products in NumPy", of["small"], of["image_us"], "us")
    set_up_ms = 1e3 * of["set_up_s"]
    row("set-up, as it comes", 1e3 * of["usual"], set_up_ms, "ms")
    row("set-up, readings x readings", 1e3 * of["equal"], set_up_ms, "ms")
    row("the same with pyEIT's mesh", 1e3 * (of["equal"] + mesh_s), set_up_ms, "ms")


if __name__ == "__main__":
    main()
