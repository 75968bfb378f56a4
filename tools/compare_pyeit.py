"""Sets the linear image of tactomo against pyEIT's one-step solver, in one run on one core.

Both have 16 electrodes and the same number of nodes. pyEIT: its own mesh of a disc, Jacobian and one-step Gauss-Newton with the NOSER
prior (jac.JAC, "kotre"), adjacent driving, 208 readings, an image on elements. tactomo: the thin shell of square-60, mesh
and Jacobian included, Tikhonov's image of 256 readings on nodes. Frames are timed in turns, so that a load of the machine
falls on both.

    python3 -m venv .venv && .venv/bin/pip install pyeit==1.2.4
    .venv/bin/python tools/compare_pyeit.py [SIZE [PROGRAM]]

SIZE is pyEIT's mesh size (0.045 makes about 1800 nodes), PROGRAM the example `speed` where it is built already.
"""

import json
import os
import subprocess
import sys
import time

# One core for everybody; before NumPy is there.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import numpy as np  # noqa: E402
import pyeit.eit.jac as jac  # noqa: E402
import pyeit.eit.protocol as protocol  # noqa: E402
import pyeit.mesh as mesh  # noqa: E402

ROUNDS = 5
FRAMES = 400


def tactomo(nodes):
    run = ["cargo", "run", "--release", "--quiet", "--package", "tactomo", "--example", "speed", "--"]
    command = sys.argv[2:3] or run
    return json.loads(subprocess.run([*command, str(nodes)], check=True, capture_output=True, text=True).stdout)


def pyeit_set_up(size):
    begin = time.perf_counter()
    disc = mesh.create(16, h0=size)
    meshed = time.perf_counter()
    solver = jac.JAC(disc, protocol.create(16, dist_exc=1, step_meas=1, parser_meas="std"))
    solver.setup(p=0.5, lamb=0.01, method="kotre", perm=1, jac_normalized=True)
    return disc, solver, meshed - begin, time.perf_counter() - meshed


def pyeit_frame(solver):
    rest = np.linspace(0.5, 1.0, solver.H.shape[1])
    pressed = rest * 1.01
    times = []
    for _ in range(FRAMES):
        begin = time.perf_counter()
        solver.solve(pressed, rest, normalize=True)
        times.append(time.perf_counter() - begin)
    return np.median(times) * 1e6


def main():
    size = float(sys.argv[1]) if len(sys.argv) > 1 else 0.045
    disc, solver, mesh_s, set_up_s = pyeit_set_up(size)
    nodes, elements = len(disc.node), len(disc.element)
    tactomo(nodes)  # Built once, before anything is timed.
    ours, theirs = [], []
    for _ in range(ROUNDS):
        theirs.append(pyeit_frame(solver))
        ours.append(tactomo(nodes))
    frame_us = np.median([run["frame_us"] for run in ours])
    set_up_ms = np.median([run["set_up_ms"] for run in ours])
    print(f"pyEIT:   {nodes} nodes, {elements} elements; mesh {mesh_s:.2f} s, solver {set_up_s:.2f} s, frame {np.median(theirs):.1f} us")
    print(f"tactomo: {ours[0]['nodes']} nodes; mesh, model and solver {set_up_ms:.1f} ms, frame {frame_us:.1f} us")
    print(
        f"ratios:  frame {np.median(theirs) / frame_us:.0f}, set-up {set_up_s * 1e3 / set_up_ms:.0f} "
        f"without pyEIT's mesh, {(mesh_s + set_up_s) * 1e3 / set_up_ms:.0f} with it"
    )


if __name__ == "__main__":
    main()
