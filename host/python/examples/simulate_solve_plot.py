"""Simulates presses on a sensor that is not quite the one described, solves them, and plots what was found.

    python simulate_solve_plot.py [picture.png]

Needs matplotlib.
"""

import sys

import matplotlib.pyplot as plt
import tactomo
from matplotlib.tri import Triangulation

# %% What touches: two fingertips, on a detector as it may have been built.
described = tactomo.Detector("square-60")
presses = [
    tactomo.Contact(x_m=-0.012, y_m=0.008, radius_m=0.004, conductance_s=8e-4),
    tactomo.Contact(x_m=0.014, y_m=-0.010, radius_m=0.003, conductance_s=3e-4),
]
board = tactomo.Simulator(described.as_built(seed=3))
readings = board.readings(presses)  # (16, 16), V

# %% What solvers make of it, who know the description only.
solvers = {name: tactomo.Solver(name, described) for name in ("tikhonov", "nonlinear", "contacts")}
solutions = {name: solver.solve(readings) for name, solver in solvers.items()}

for contact in solutions["contacts"].contacts:
    print(
        f"contact at {contact.x_m * 1e3:.1f}, {contact.y_m * 1e3:.1f} mm"
        f" +- {contact.sigma_x_m * 1e3:.1f}, {contact.sigma_y_m * 1e3:.1f} mm, {contact.conductance_s * 1e3:.2f} mS"
    )
if solutions["contacts"].flags.calibrate:
    print("a calibration would tell more: see tactomo.Calibration.rub")

# %% Plot.
figure, axes = plt.subplots(1, 4, figsize=(15, 4), layout="constrained")
axes[0].set_title("readings (V)")
axes[0].set(xlabel="electrode read", ylabel="electrode grounded")
figure.colorbar(axes[0].imshow(readings))
for axis, (name, solution) in zip(axes[1:], solutions.items(), strict=True):
    axis.set_title(name)
    axis.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", xlim=(-30, 30), ylim=(-30, 30))
    if solution.image is not None:
        mesh = solvers[name].mesh
        triangles = Triangulation(*(mesh.nodes_m.T * 1e3), mesh.triangles)
        figure.colorbar(axis.tripcolor(triangles, solution.image, shading="gouraud"), label="S/m²")
    axis.plot(*(described.electrodes_m[:, :2].T * 1e3), ".", color="grey", markersize=4)
    axis.plot([press.x_m * 1e3 for press in presses], [press.y_m * 1e3 for press in presses], "rx", label="pressed")
    found = solution.array
    axis.plot(found["x_m"] * 1e3, found["y_m"] * 1e3, "o", fillstyle="none", color="k", label="found")
axes[-1].legend(loc="lower left")

if len(sys.argv) > 1:
    figure.savefig(sys.argv[1], dpi=100)
else:
    plt.show()
