"""Images of real tanks with a known answer: by the fields of tactomo's thin shell, and by pyEIT.

Four data sets that come with EIDORS (https://github.com/eidors3d/eidors-readonly), in its folders `eidors/sample_data` and `htdocs/data_contrib`; they
stay where they are. All have 16 electrodes, adjacent drive and adjacent readings:

- `iirc_data_2006.mat`: a tank of 20 cm with round electrodes of 1 cm and 6 cm of saline, empty, and with a rod of 2 cm that is rotated in it.
- `montreal_data_1995.mat` (A. Adler, CC BY-ND 2.5; A. Adler and W. R. B. Lionheart, "Uses and abuses of EIDORS", Physiol. Meas. 2006): a rod is moved
  in a circle around a tank of 30 cm, and diametrically across it.
- `ottawa_2dphantom_data_2008.mat`: a glass and a metal target in a tank, round and squeezed at two and at three points, photographed from above. The
  readme has the picture's places. The photographed electrodes are fitted to a regular polygon (an affine map, which takes out the camera's view and
  most of a squeeze), and the targets go with them.
- `ds_data_2004.zip` (D. Stephenson): a metal and a plastic rod in the same place near the first electrode, and two of either 45, 90 and 180 degrees
  apart about the middle. So their names say, and nothing else does.

Both programs are told that tanks are round and electrodes even. Places are in radii of the tank, the first electrode at the top and the others clockwise.

First the empty tanks: how far the readings of either model are from the measured ones, over the root mean square of these, after one factor for all,
and those of an even disc with points on its rim, by formula: no sheet can do much better in a tank that has depth. Montreal's are not of this kind:
gains differ from channel to channel. Then images: one step of Gauss and Newton on relative changes, with the same prior and lambda, on each program's
own mesh and Jacobian, drawn on 32 x 32 pixels as GREIT does (Adler and others, Physiol. Meas. 2009): tactomo's triangles are far smaller at electrodes.
A target is where the image is beyond half of its extreme: its middle, by area and value, and the radius of a disc of its area.

    python3 -m venv .venv && .venv/bin/pip install pyeit==1.2.4
    .venv/bin/python tools/compare_tank.py EIDORS [PROGRAM]

EIDORS is its folder, PROGRAM the example `tank` where it is built already.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import zipfile

import matplotlib.tri
import numpy as np
import pyeit.eit.jac as jac
import pyeit.eit.protocol as protocol
import pyeit.mesh as mesh
import scipy.io

ELECTRODES = 16
OTTAWA, MONTREAL, IIRC = "ottawa_2dphantom_data_2008", "montreal_data_1995", "iirc_data_2006"
POWER, LAMBDA = 0.5, 0.01
# Pixels from side to side, and places in each of them, from side to side, that its mean is taken over.
PIXELS, INSIDE = 32, 8
# Numbers of the photographed frames: empty, and with a glass and a metal target.
TANKS = {"round": (20, 21, 22), "squeezed at two points": (23, 24, 25), "squeezed at three points": (26, 27, 28)}
PAIRS = [(drive, read) for drive in range(ELECTRODES) for read in range(ELECTRODES) if (read - drive) % ELECTRODES not in (0, 1, 15)]
# The first at the top, the others clockwise; x + iy.
REGULAR = 1j * np.exp(-2j * np.pi * np.arange(ELECTRODES) / ELECTRODES)


def onto(places, targets):
    """The affine map that takes places next to targets, and how far off they are then (root mean square)."""
    rows = np.column_stack([places.real, places.imag, np.ones(len(places))])
    matrix, *_ = np.linalg.lstsq(rows, np.column_stack([targets.real, targets.imag]), rcond=None)

    def mapped(place):
        x, y = np.array([place.real, place.imag, 1.0]) @ matrix
        return x + 1j * y

    off = np.array([mapped(place) for place in places]) - targets
    return mapped, np.sqrt(np.mean(np.abs(off) ** 2))


def photographed(folder):
    """Of each frame the target's middle and radius, if there is one, and how far electrodes are off their places, in radii of the tank."""
    text = (folder / f"{OTTAWA}-readme.txt").read_text(errors="replace")
    rows = re.search(r"d = \[(.*?)\];", text, re.DOTALL).group(1).split(";")
    table = np.array([[float(word) for word in row.split(",")] for row in rows])
    known = {}
    for column, frame in enumerate(range(20, 29)):
        # Rows of a picture go down.
        places = table[:, 2 * column] - 1j * table[:, 2 * column + 1]
        mapped, off = onto(places[3 : 3 + ELECTRODES], REGULAR)
        target = (mapped(places[20]), abs(mapped(places[21]) - mapped(places[20]))) if places[20] else None
        known[frame] = (target, off)
    return known


def measured(folder, name):
    """Arrays of a file: a column a frame, 208 readings in the order of PAIRS."""
    where = [ELECTRODES * drive + read for drive, read in PAIRS]
    arrays = scipy.io.loadmat(folder / f"{name}.mat")
    return {key: np.abs(of[where]).astype(float) for key, of in arrays.items() if np.shape(of)[:1] == (ELECTRODES**2,)}


def stephenson(folder):
    """Readings (V) by file; water is the mean of three."""
    with zipfile.ZipFile(folder / "ds_data_2004.zip") as files:
        texts = {pathlib.PurePath(name).stem: files.read(name).decode() for name in files.namelist() if name.endswith(".txt")}
    rows = {name: np.loadtxt(text.splitlines())[: len(PAIRS)] for name, text in texts.items()}
    volts = {name: np.hypot(of[:, 0], of[:, 1]) for name, of in rows.items()}
    return volts | {"water": np.mean([of for name, of in volts.items() if name.startswith("water")], axis=0)}


def changes(full, empty):
    return ((full - empty) / empty).T


def by_tactomo(changes):
    """Readings of the empty tank; middles of triangles, their areas, and an image for each change."""
    run = ["cargo", "run", "--release", "--quiet", "--package", "tactomo-lab", "--example", "tank", "--"]
    with tempfile.TemporaryDirectory() as folder:
        frames, out = pathlib.Path(folder) / "frames.npz", pathlib.Path(folder) / "out.npz"
        np.savez(frames, frames=np.array(changes))
        subprocess.run([*(sys.argv[2:3] or run), str(frames), str(out)], check=True)
        given = np.load(out)
        nodes = given["nodes"] @ [1, 1j]
        return given["rest"], nodes[given["triangles"].astype(int)], given["image"]


def by_pyeit(changes):
    disc = mesh.create(ELECTRODES, h0=0.06)
    patterns = protocol.create(ELECTRODES, dist_exc=1, step_meas=1, parser_meas="std")
    solver = jac.JAC(disc, patterns)
    solver.setup(p=POWER, lamb=LAMBDA, method="kotre", perm=1, jac_normalized=True)
    # Its readings are in its own order, and a pair of neighbours may be told either way round.
    first = {frozenset((n, (n + 1) % ELECTRODES)): n for n in range(ELECTRODES)}
    own = [(first[frozenset(map(int, drive))], first[frozenset(map(int, read[:2]))]) for drive, reads in zip(patterns.ex_mat, patterns.meas_mat) for read in reads]
    order = [PAIRS.index(pair) for pair in own]
    rest = np.empty(len(PAIRS))
    rest[order] = solver.v0
    ones = np.ones(len(PAIRS))
    images = [solver.solve(ones + change[order], ones, normalize=True).real for change in changes]
    nodes = disc.node[:, :2] @ [1, 1j]
    electrodes = nodes[disc.el_pos]
    # Its electrodes begin elsewhere and may go the other way round.
    mapped, off = onto(electrodes, REGULAR)
    assert off < 1e-3, f"pyEIT's electrodes are {off} off a regular polygon"
    return rest, np.array([mapped(node) for node in nodes])[disc.element], np.array(images)


def apart(model, tank):
    """Root mean square of what is left of the readings after one factor, over theirs."""
    model = np.abs(model)
    factor = model @ tank / (model @ model)
    return np.linalg.norm(tank - factor * model) / np.linalg.norm(tank)


def points():
    """Readings of an even disc with points on its rim: a current's potential there is that of a logarithm."""
    apart = lambda a, b: -np.log(abs(REGULAR[a % ELECTRODES] - REGULAR[b % ELECTRODES]))
    return np.array([apart(r, d) - apart(r + 1, d) - apart(r, d + 1) + apart(r + 1, d + 1) for d, r in PAIRS])


def drawn(triangles, images):
    """Middles of pixels, how much of each is in the tank, and a row of their values for each image."""
    nodes, corners = np.unique(triangles, return_inverse=True)
    find = matplotlib.tri.Triangulation(nodes.real, nodes.imag, corners.reshape(triangles.shape)).get_trifinder()
    along = (np.arange(PIXELS * INSIDE) + 0.5) / (PIXELS * INSIDE) * 2 - 1
    found = find(*np.meshgrid(along, along))
    in_pixels = lambda of: of.reshape(PIXELS, INSIDE, PIXELS, INSIDE).sum(axis=(1, 3)).ravel()
    counts = in_pixels((found >= 0).astype(float))
    values = [in_pixels(np.where(found >= 0, image[found], 0.0)) / np.maximum(counts, 1) for image in images]
    middles = along.reshape(PIXELS, INSIDE).mean(axis=1)
    return (middles + 1j * middles[:, None]).ravel(), counts / INSIDE**2, values


def beyond_half(shares, image):
    """The extreme, and how much of a pixel counts where the image is beyond half of it."""
    extreme = image[np.argmax(np.abs(image))]
    return extreme, np.where(image / extreme > 0.5, shares, 0.0)


def spot(places, shares, image):
    """Of what is beyond half of the extreme the middle, the extreme, and the radius of a disc of its area."""
    extreme, counted = beyond_half(shares, image)
    weights = counted * image / extreme
    return weights @ places / weights.sum(), extreme, np.sqrt(counted.sum() / np.pi) * 2 / PIXELS


def two(places, shares, image):
    """The middles of the two parts that what is beyond half of the extreme falls into best (two means)."""
    extreme, counted = beyond_half(shares, image)
    weights, best = counted * image / extreme, (np.inf, None)
    for angle in np.linspace(0, np.pi, 12, endpoint=False):
        pair = weights @ places / weights.sum() + 0.3 * np.exp(1j * angle) * np.array([1, -1])
        for _ in range(50):
            nearest = np.abs(places[:, None] - pair).argmin(axis=1)
            parts = weights[:, None] * np.eye(2)[nearest]
            pair = places @ parts / np.maximum(parts.sum(axis=0), 1e-300)
        best = min(best, (weights @ np.abs(places - pair[nearest]) ** 2, pair), key=lambda one: one[0])
    return best[1]


def circle(places):
    """Mean distance from the tank's middle, its standard deviation, and how far the middle of the best circle is off the tank's."""
    rows = np.column_stack([places.real, places.imag, np.ones(len(places))])
    (x, y, _), *_ = np.linalg.lstsq(rows, np.abs(places) ** 2, rcond=None)
    return f"{np.mean(np.abs(places)):.2f} | {np.std(np.abs(places)):.3f} | {np.hypot(x, y) / 2:.3f}"


def line(places):
    """Root mean square distance from the best straight line, and how far that is from the tank's middle."""
    middle = places.mean()
    points = np.column_stack([(places - middle).real, (places - middle).imag])
    across = np.linalg.svd(points)[2][1]
    return f"{np.sqrt(np.mean((points @ across) ** 2)):.3f} | {abs(across @ [middle.real, middle.imag]):.3f}"


def main():
    if len(sys.argv) < 2:
        sys.exit("the folder of EIDORS is needed")
    folder = pathlib.Path(sys.argv[1]) / "eidors/sample_data"
    rods = stephenson(pathlib.Path(sys.argv[1]) / "htdocs/data_contrib/ds_tank_phantom")
    known = photographed(folder)
    ottawa, montreal, iirc = (measured(folder, name) for name in (OTTAWA, MONTREAL, IIRC))
    tank = {frame: ottawa[f"phantomdata_{frame}"] for frame in known}
    targets = [
        (shape, target, frame, empty)
        for shape, (empty, *full) in TANKS.items()
        for target, frame in zip(("glass", "metal"), full)
    ]
    single, pairs = ([f"{of}_{rest}" for of in ("metal", "plastic") for rest in names] for names in (("1",), ("2_45", "2_90", "2_180")))
    parts = [
        *(changes(tank[frame], tank[empty]) for *_, frame, empty in targets),
        changes(montreal["zc_demo3"], montreal["zc_h_demo3"]),
        changes(montreal["zc_demo4"], montreal["zc_h_demo4"]),
        changes(iirc["v_rotate"], iirc["v_reference"]),
        *(changes(rods[name][:, None], rods["water"][:, None]) for name in single + pairs),
    ]
    ends = np.cumsum([len(part) for part in parts])
    tanks = {"IIRC": iirc["v_reference"].ravel(), "Ottawa": tank[20].ravel(), "Stephenson": rods["water"]}
    misfits = lambda model: ", ".join(f"{tank} {100 * apart(model, readings):.1f} %" for tank, readings in tanks.items())
    print(f"empty tanks, a disc with points on its rim: {misfits(points())}")
    found, degrees = {}, {}
    for name, method in {"tactomo": by_tactomo, "pyEIT": by_pyeit}.items():
        rest, triangles, images = method(list(np.concatenate(parts)))
        print(f"empty tanks, {name}, {len(triangles)} triangles: {misfits(rest)}; {100 * apart(rest, points()):.1f} % from the disc")
        places, shares, images = drawn(triangles, images)
        found[name] = np.split(np.array([spot(places, shares, image) for image in images]), ends[:-1])
        both = (two(places, shares, image) for image in images[-len(pairs) :])
        degrees[name] = [np.degrees(abs(np.angle(one / other))) for one, other in both]

    print("\n| tank | target | photographed at | radius | electrodes off by | " + " | ".join(f"{name} | apart | radius" for name in found) + " |")
    print("|---" * (5 + 3 * len(found)) + "|")
    for index, (shape, target, frame, _) in enumerate(targets):
        (at, radius), off = known[frame]
        cells = [shape, target, f"{at.real:+.2f}, {at.imag:+.2f}", f"{radius:.2f}", f"{off:.2f}"]
        for of in found.values():
            place, extreme, seen = of[index][0]
            sign = "+" if extreme.real > 0 else "-"
            cells += [f"{place.real:+.2f}, {place.imag:+.2f} ({sign})", f"{abs(place - at):.2f}", f"{seen.real:.2f}"]
        print("| " + " | ".join(cells) + " |")

    print("\n| rod in a circle | | distance from the middle | its deviation | circle's middle off by | rod's radius |\n|---|---|---|---|---|---|")
    circled, across, rotated = range(len(targets), len(targets) + 3)
    for data, part in (("Montreal", circled), ("IIRC", rotated)):
        for name, of in found.items():
            print(f"| {data} | {name} | {circle(of[part][:, 0])} | {of[part][:, 2].real.mean():.2f} |")
    print("\n| rod across | | off a straight line | line off the middle |\n|---|---|---|---|")
    for name, of in found.items():
        print(f"| Montreal | {name} | {line(of[across][:, 0])} |")

    print("\n| Stephenson | metal at | plastic at | apart | " + " | ".join(f"{name}: degrees" for name in pairs) + " |")
    print("|---" * (4 + len(pairs)) + "|")
    for name, of in found.items():
        metal, plastic = (of[rotated + 1 + index][0, 0] for index in range(len(single)))
        cells = [f"{place.real:+.2f}, {place.imag:+.2f}" for place in (metal, plastic)] + [f"{abs(metal - plastic):.2f}"]
        print(f"| {name} | " + " | ".join(cells + [f"{angle:.0f}" for angle in degrees[name]]) + " |")


if __name__ == "__main__":
    main()
