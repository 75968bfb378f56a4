"""Sets the linear image of tactomo against pyEIT's one-step solver, in CPU seconds on one thread each.

Both have 16 electrodes and about the same number of unknowns: values on elements for pyEIT, on nodes for tactomo. pyEIT: its own mesh of a
disc, Jacobian and one-step Gauss-Newton with the NOSER prior (jac.JAC, "kotre"), adjacent driving, 208 readings. tactomo: the thin shell of
square-60, mesh and Jacobian included, Tikhonov's image of 256 readings.

Two set-ups of pyEIT are measured. As it comes, its solver inverts a matrix of elements x elements. The same matrix is algebraically
equal to one made from an inverse of readings x readings, H = W^-1 J' (J W^-1 J' + l^2)^-1 with the diagonal prior W (the matrix inversion
lemma), which pyEIT does not use; that is checked here to rounding and timed too: what an algorithm costs that is as good as it can be.

Set-ups are made several times on both sides and their medians compared; frames are timed in turns. Times are those of the processor
(`time.process_time`, and the same clock of the thread in `speed`), so that other load counts for little. One thread each.

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

SET_UPS = 5
ROUNDS = 5
FRAMES = 400
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


def pyeit_frame_us(solver):
    rest = np.linspace(0.5, 1.0, solver.H.shape[1])
    pressed = rest * 1.01
    _, taken = cpu_s(lambda: [solver.solve(pressed, rest, normalize=True) for _ in range(FRAMES)])
    return taken / FRAMES * 1e6


def tactomo(nodes):
    run = ["cargo", "run", "--release", "--quiet", "--package", "tactomo-lab", "--example", "speed", "--"]
    command = sys.argv[2:3] or run
    return json.loads(subprocess.run([*command, str(nodes)], check=True, capture_output=True, text=True).stdout)


def main():
    size = float(sys.argv[1]) if len(sys.argv) > 1 else 0.06
    disc, mesh_s = cpu_s(lambda: mesh.create(16, h0=size))
    elements = len(disc.element)
    # Built once, before anything is timed; a mesh has somewhat other nodes than it is asked for.
    nodes = round(elements * elements / tactomo(elements)["nodes"])
    ours, usual_s, equal_s, frames_us = [], [], [], []
    for _ in range(SET_UPS):
        solver, made_s = cpu_s(lambda: pyeit_solver(disc))
        matrix, taken_s = cpu_s(lambda: as_it_comes(solver))
        usual_s.append(made_s + taken_s)
        jacobian, jacobian_s = cpu_s(lambda: solver.fwd.compute_jac(normalize=True)[0])
        equal, taken_s = cpu_s(lambda: by_readings(jacobian))
        equal_s.append(made_s + jacobian_s + taken_s)
        off = np.abs(np.abs(equal) - np.abs(matrix)).max() / np.abs(matrix).max()
        assert off < 1e-6, f"the two forms differ by {off}"
        frames_us.append(pyeit_frame_us(solver))
        ours.append(tactomo(nodes))
    frame_us, set_up_s = (np.median([run[name] for run in ours]) for name in ("frame_us", "set_up_s"))
    usual, equal, theirs_us = np.median(usual_s), np.median(equal_s), np.median(frames_us)
    print(f"pyEIT:   {elements} elements; mesh {mesh_s:.2f} s, solver {usual:.3f} s, in its 208 x 208 form {equal:.3f} s, frame {theirs_us:.1f} us")
    print(f"tactomo: {ours[0]['nodes']} nodes; mesh, model and solver {set_up_s * 1e3:.1f} ms, frame {frame_us:.1f} us")
    print(f"ratios:  frame {theirs_us / frame_us:.0f}; set-up {usual / set_up_s:.0f}, of the 208 x 208 form {equal / set_up_s:.1f}; with pyEIT's mesh ", end="")
    print(f"{(mesh_s + usual) / set_up_s:.0f} and {(mesh_s + equal) / set_up_s:.0f}")


if __name__ == "__main__":
    main()
