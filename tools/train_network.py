#!/usr/bin/env python3
"""Trains the solver `network` on simulated frames, or fine-tunes it on those of one calibrated detector.

    pip install jax optax numpy safetensors
    cargo run --release --package tactomo-lab --example network_data -- train.npz square-60 1500 30 1
    cargo run --release --package tactomo-lab --example network_data -- limits.npz square-60 100 30 2
    python3 tools/train_network.py --train train.npz --limits limits.npz --detector square-60 --out network.safetensors

Fine-tuning takes data of the calibrated detector (the example's DETECTOR is then the calibration's file) and `--from network.safetensors`.

The network (`host/touch/src/learned/network/` runs it) reads the features of a frame (`features` below), three hidden layers, and has heads for
an image, a map of contacts, their number, the total conductance, and the features themselves: what it cannot give back it never saw. The square's
eight symmetries multiply the frames. All seeds are fixed.
"""

import argparse
import json
import time

import jax
import jax.numpy as jnp
import numpy as np
import optax
from safetensors.numpy import load_file, save_file

VERSION = "1"
SIDE = 32
MOST = 5
# Smallest `1 - V / Vcc` that a ratio is taken of, as in `solve/fit/balance.rs`.
SMALLEST = 1e-3
# Classes of the number of contacts: 0 to 5, and one shape.
CLASSES = MOST + 2
# Standard deviations (m): of the bumps on the map of contacts, and of the smoothing before images are compared.
BUMP_M = 0.0025
SMOOTHING_M = 0.002
# Half the width of the window that a place is the centroid of, in nodes.
WINDOW = 3
# Smallest total conductance that is told apart, in sheet conductances.
LEAST_SHEETS = 1e-3
# Quantile of the echo's error, of frames like those trained with, that is the limit of what was seen.
SEEN = 0.99
LIMITS = 8


def features(readings_v, drive_v):
    """`frames x (n^2 + n + 1)`: balanced readings over their size, logarithms of the rows' scales, and that of the size."""
    n = readings_v.shape[1]
    volts = np.clip(readings_v, -drive_v, drive_v)
    logs = np.log(np.maximum(1.0 - volts / drive_v, SMALLEST))
    scales = logs.mean(axis=1) - logs.mean(axis=2)
    balanced = volts * np.exp(scales)[:, :, None]
    size = np.maximum(np.sqrt((balanced**2).mean(axis=(1, 2))) / drive_v, 1e-6)
    direction = balanced / (drive_v * size[:, None, None])
    return np.concatenate([direction.reshape(len(volts), n * n), scales, np.log(size)[:, None]], axis=1).astype(np.float32)


class Data:
    """Frames, and what touched in each."""

    def __init__(self, path):
        file = np.load(path)
        self.drive_v, self.sheet_s = float(file["drive_v"][0]), float(file["sheet_s"][0])
        self.size_m, self.thickness_m = file["size_m"], float(file["thickness_m"][0])
        self.lsb_v, self.electrodes_m = float(file["lsb_v"][0]), file["electrodes_m"]
        self.features = features(file["readings_v"], self.drive_v)
        self.view = file["view"].astype(int)
        scene = file["scene"].astype(int)
        density = file["image_s_per_m2"].reshape(-1, SIDE * SIDE)
        step_m = self.size_m / (SIDE - 1)
        edge = np.ones(SIDE)
        edge[[0, -1]] = 0.5
        # Conductance of each node's cell, in sheet conductances.
        cells_m2 = np.outer(edge, edge).ravel() * step_m.prod()
        siemens = density * cells_m2 / self.sheet_s
        self.total = siemens.sum(axis=1)[scene]
        self.image = density.astype(np.float32)[scene]
        self.contacts = file["contacts"].astype(np.float32)[scene]
        self.count = file["count"].astype(int)[scene]

    def __len__(self):
        return len(self.features)


def symmetries(electrodes_m):
    """Of each of the square's symmetries that the electrodes have: orders of features and nodes, and what it does to a place."""
    n = len(electrodes_m)
    nodes = np.stack(np.meshgrid(np.linspace(-1, 1, SIDE), np.linspace(-1, 1, SIDE)), axis=-1).reshape(-1, 2)
    found = []
    for swap in (False, True):
        for signs in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
            turn = np.diag(signs).astype(float)
            turn = turn[:, ::-1] if swap else turn
            order = [nearest(electrodes_m, turn.T @ place_m) for place_m in electrodes_m]
            if any(distance > 1e-4 for _, distance in order):
                continue
            order = np.array([index for index, _ in order])
            pairs = (order[:, None] * n + order[None, :]).ravel()
            columns = np.concatenate([pairs, n * n + order, [n * n + n]])
            image = np.array([nearest(nodes, turn.T @ node)[0] for node in nodes])
            found.append((columns, image, turn.astype(np.float32)))
    return found


def nearest(places, place):
    distances = np.hypot(*(places - place).T)
    return int(distances.argmin()), float(distances.min())


def smoothing(size_m, deviation_m):
    """`SIDE x SIDE` along x and y: Gaussian weights that add up to one."""
    at = np.linspace(-0.5, 0.5, SIDE)
    matrices = []
    for side_m in size_m:
        weights = np.exp(-0.5 * ((at[:, None] - at[None, :]) * side_m / deviation_m) ** 2)
        matrices.append((weights / weights.sum(axis=1, keepdims=True)).astype(np.float32))
    return matrices


def start(key, sizes, heads):
    """Weights `inputs x outputs` of the hidden layers and the heads."""
    weights = {}
    layers = [(f"hidden_{i}", pair) for i, pair in enumerate(zip(sizes[:-1], sizes[1:]))]
    layers += [(name, (sizes[-1], outputs)) for name, outputs in heads.items()]
    for name, (inputs, outputs) in layers:
        key, part = jax.random.split(key)
        scale = np.sqrt((2.0 if name.startswith("hidden") else 0.5) / inputs)
        weights[name + ".weight"] = scale * jax.random.normal(part, (inputs, outputs), jnp.float32)
        weights[name + ".bias"] = jnp.zeros(outputs, jnp.float32)
    weights["map.bias"] -= 4.0
    return weights


def run(weights, inputs):
    """The heads of standardised features."""
    hidden, layer = inputs, 0
    while f"hidden_{layer}.weight" in weights:
        hidden = jax.nn.relu(hidden @ weights[f"hidden_{layer}.weight"] + weights[f"hidden_{layer}.bias"])
        layer += 1
    return {head: hidden @ weights[head + ".weight"] + weights[head + ".bias"] for head in ("image", "map", "count", "total", "echo")}


def correlation(a, b):
    a, b = (x - x.mean(axis=1, keepdims=True) for x in (a, b))
    return (a * b).sum(axis=1) / jnp.sqrt((a * a).sum(axis=1) * (b * b).sum(axis=1) + 1e-20)


def make_loss(size_m):
    """Mean loss over a batch."""
    smooth_x, smooth_y = smoothing(size_m, SMOOTHING_M)
    half_m = size_m / 2
    nodes_m = np.stack(np.meshgrid(*[np.linspace(-h, h, SIDE) for h in half_m]), axis=-1).reshape(-1, 2).astype(np.float32)

    def smoothed(image):
        return (smooth_y @ image.reshape(-1, SIDE, SIDE) @ smooth_x.T).reshape(-1, SIDE * SIDE)

    def window(logits, at_m):
        """Centroid of the map about a place."""
        step_m = 2 * half_m / (SIDE - 1)
        near = jnp.round((at_m + half_m) / step_m) * step_m - half_m
        inside = (jnp.abs(nodes_m[None, None] - near[:, :, None]) < (WINDOW + 0.5) * step_m).all(axis=-1)
        share = jax.nn.sigmoid(logits)[:, None] * inside
        return (share @ nodes_m) / (share.sum(axis=-1, keepdims=True) + 1e-6)

    def loss(weights, batch):
        inputs, image, contacts, count, total = batch
        heads = run(weights, inputs)
        touched = (count != 0).astype(jnp.float32)
        given = jax.nn.softmax(heads["image"])
        truth = image / (image.sum(axis=1, keepdims=True) + 1e-12)
        likeness = correlation(smoothed(given), smoothed(truth))
        entropy = -(smoothed(truth) * jax.nn.log_softmax(heads["image"])).sum(axis=1)
        real = (jnp.arange(MOST)[None] < count[:, None]).astype(jnp.float32)
        at_m = contacts[:, :, :2]
        distance2 = ((nodes_m[None, None] - at_m[:, :, None]) ** 2).sum(axis=-1)
        bumps = (jnp.exp(-0.5 * distance2 / BUMP_M**2) * real[:, :, None]).max(axis=1)
        is_few = (count >= 0).astype(jnp.float32)
        crossed = optax.sigmoid_binary_cross_entropy(heads["map"], bumps).sum(axis=1)
        missed_mm = 1e3 * jnp.sqrt(((window(heads["map"], at_m) - at_m) ** 2).sum(axis=-1) + 1e-8)
        missed_mm = (missed_mm * real).sum(axis=1) / jnp.maximum(real.sum(axis=1), 1.0)
        number = optax.softmax_cross_entropy_with_integer_labels(heads["count"], jnp.where(count < 0, MOST + 1, count))
        sheets = jnp.log(jnp.maximum(total, LEAST_SHEETS))
        strength = optax.huber_loss(heads["total"][:, 0], sheets, delta=0.5)
        echo = ((heads["echo"] - inputs) ** 2).mean(axis=1)
        parts = {
            "image": touched * (1.0 - likeness + 0.05 * entropy),
            "map": 0.03 * is_few * crossed,
            "place": 0.3 * missed_mm,
            "count": 0.3 * number,
            "total": 0.3 * touched * strength,
            "echo": 0.5 * echo,
        }
        return sum(part.mean() for part in parts.values()), {name: part.mean() for name, part in parts.items()}

    return loss


def peaks(logits, count, size_m):
    """Places (m) of the highest peaks of a map: the centroid about each, of all that is not nearer to another one."""
    share = 1.0 / (1.0 + np.exp(-logits.reshape(SIDE, SIDE)))
    step_m = size_m / (SIDE - 1)
    padded = np.pad(share, 2, constant_values=-1.0)
    around = np.stack([padded[2 + j : 2 + j + SIDE, 2 + i : 2 + i + SIDE] for j in range(-2, 3) for i in range(-2, 3)])
    tops = np.argwhere(share >= around.max(axis=0))
    tops = sorted(tops.tolist(), key=lambda at: -share[at[0], at[1]])[:count]
    found = []
    for j, i in tops:
        js, is_ = np.arange(max(j - WINDOW, 0), min(j + WINDOW + 1, SIDE)), np.arange(max(i - WINDOW, 0), min(i + WINDOW + 1, SIDE))
        part = share[np.ix_(js, is_)].copy()
        for other_j, other_i in tops:
            nearer = (js[:, None] - other_j) ** 2 + (is_[None] - other_i) ** 2 < (js[:, None] - j) ** 2 + (is_[None] - i) ** 2
            part[nearer] = 0.0
        y, x = (part.sum(axis=1) @ js) / part.sum(), (part.sum(axis=0) @ is_) / part.sum()
        found.append((x * step_m[0] - size_m[0] / 2, y * step_m[1] - size_m[1] / 2))
    return np.array(found).reshape(-1, 2)


def report(weights, data, inputs, chosen, title):
    """Prints how it does on some frames."""
    heads = {name: np.asarray(values) for name, values in jax.jit(run)(weights, inputs[chosen]).items()}
    count = data.count[chosen]
    told = heads["count"].argmax(axis=1)
    smooth_x, smooth_y = smoothing(data.size_m, SMOOTHING_M)
    smooth = lambda image: (smooth_y @ image.reshape(-1, SIDE, SIDE) @ smooth_x.T).reshape(-1, SIDE * SIDE)
    likeness = np.asarray(correlation(smooth(np.asarray(jax.nn.softmax(heads["image"]))), smooth(data.image[chosen])))
    single = np.flatnonzero(count == 1)
    missed_mm = [1e3 * np.hypot(*(peaks(heads["map"][k], 1, data.size_m)[0] - data.contacts[chosen][k, 0, :2])) for k in single]
    missed_mm = np.array(missed_mm)
    light = data.total[chosen][single] < 0.1
    echo = np.sqrt(((heads["echo"] - inputs[chosen]) ** 2).mean(axis=1))
    print(f"{title}: {len(count)} frames; one contact {missed_mm.mean():.2f} mm (p95 {np.quantile(missed_mm, 0.95):.2f}, light "
          f"{missed_mm[light].mean():.2f}, firmer {missed_mm[~light].mean():.2f}), count right {np.mean(told[single] == 1):.2f};", end=" ")
    for k in (2, 3, 5, -1):
        which = count == k
        label = CLASSES - 1 if k < 0 else k
        print(f"[{k}] count {np.mean(told[which] == label):.2f} corr {likeness[which].mean():.2f};", end=" ")
    print(f"echo {np.quantile(echo, 0.5):.3f}", flush=True)


def train(args, data, held, mean, deviation, weights):
    """Adam with a rate that rises, and falls along a cosine."""
    turned = symmetries(data.electrodes_m)
    print(f"{len(data)} frames, {len(turned)} symmetries", flush=True)
    steps = args.epochs * (len(data) // args.batch)
    schedule = optax.warmup_cosine_decay_schedule(0.0, args.rate, steps // 20, steps, 0.0)
    optimiser = optax.adamw(schedule, weight_decay=args.decay)
    loss = make_loss(data.size_m)

    @jax.jit
    def step(weights, state, batch):
        (_, parts), gradient = jax.value_and_grad(loss, has_aux=True)(weights, batch)
        change, state = optimiser.update(gradient, state, weights)
        return optax.apply_updates(weights, change), state, parts

    state, random, begin = optimiser.init(weights), np.random.default_rng(args.seed), time.time()
    for epoch in range(args.epochs):
        order, parts = random.permutation(len(data)), {}
        for at in range(0, len(order) - args.batch + 1, args.batch):
            chosen = order[at : at + args.batch]
            columns, nodes, turn = turned[random.integers(len(turned))]
            rows = (data.features[chosen][:, columns] - mean) / deviation
            contacts = data.contacts[chosen].copy()
            contacts[:, :, :2] = contacts[:, :, :2] @ turn.T
            batch = (rows, data.image[chosen][:, nodes], contacts, data.count[chosen], data.total[chosen].astype(np.float32))
            weights, state, now = step(weights, state, batch)
            for name, value in now.items():
                parts[name] = parts.get(name, 0.0) + float(value) / (len(order) // args.batch)
        print(f"epoch {epoch + 1}, {time.time() - begin:.0f} s: " + ", ".join(f"{name} {value:.3f}" for name, value in parts.items()), flush=True)
        if (epoch + 1) % 5 == 0:
            report(weights, held, (held.features - mean) / deviation, np.flatnonzero(held.view == 0), "whole")
    return weights


def limits_of(weights, data, inputs):
    """Largest errors of the echo of what was seen, for sizes of readings; those of frames at rest are no matter."""
    pressed = np.flatnonzero((data.count != 0) & (data.view == 0))
    echo = np.asarray(jax.jit(run)(weights, inputs[pressed])["echo"])
    errors, sizes = np.sqrt(((echo - inputs[pressed]) ** 2).mean(axis=1)), data.features[pressed, -1]
    parts = np.array_split(np.argsort(sizes), LIMITS)
    centres = [np.median(sizes[part]) for part in parts]
    highest = [np.quantile(errors[part], SEEN) for part in parts]
    return np.array([sizes.min(), *centres, sizes.max()]), np.array([highest[0], *highest, highest[-1]])


def save(path, weights, args, data, mean, deviation, limits, seconds):
    """Writes all that `Network::from_bytes` reads."""
    tensors = {name: np.asarray(values, np.float16) for name, values in weights.items()}
    tensors |= {"mean": mean, "deviation": deviation, "size_m": data.size_m, "electrodes_m": data.electrodes_m}
    tensors |= {"thickness_m": np.array([data.thickness_m]), "seen.log_size": limits[0], "seen.echo": limits[1]}
    tensors = {name: values if values.dtype == np.float16 else values.astype(np.float32) for name, values in tensors.items()}
    metadata = {
        "tactomo": "network",
        "version": VERSION,
        "detector": args.detector,
        "inputs": "balanced readings over their size, logarithms of the rows' scales and of the size; standardised by mean and deviation",
        "training": f"{len(data)} frames, {args.epochs} epochs, seed {args.seed}, {seconds:.0f} s" + (f", from {args.start}" if args.start else ""),
    }
    save_file(tensors, path, metadata)


def load(path):
    """Weights, means and deviations of a network."""
    tensors = load_file(path)
    weights = {name: jnp.asarray(values, jnp.float32) for name, values in tensors.items() if name.endswith((".weight", ".bias"))}
    return weights, tensors["mean"], tensors["deviation"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--train", required=True, help="frames to train with")
    parser.add_argument("--limits", required=True, help="frames of other seeds, that the limits of what was seen are taken from")
    parser.add_argument("--detector", required=True, help="name of the detector")
    parser.add_argument("--out", required=True)
    parser.add_argument("--from", dest="start", help="network to fine-tune")
    parser.add_argument("--hidden", type=int, nargs=3, default=[256, 256, 128])
    parser.add_argument("--epochs", type=int, default=30)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--decay", type=float, default=1e-4)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    begin = time.time()
    data, held = Data(args.train), Data(args.limits)
    if len(data) < args.batch:
        parser.error(f"{args.train} has {len(data)} frames, but a batch takes {args.batch}: simulate more, or give a smaller --batch")
    if args.start:
        weights, mean, deviation = load(args.start)
    else:
        mean, deviation = data.features.mean(axis=0), data.features.std(axis=0) + 1e-3
        heads = {"image": SIDE * SIDE, "map": SIDE * SIDE, "count": CLASSES, "total": 1, "echo": len(mean)}
        weights = start(jax.random.PRNGKey(args.seed), [len(mean), *args.hidden], heads)
    weights = train(args, data, held, mean, deviation, weights)
    # The weights are kept in 16 bits: what follows is judged with those.
    weights = {name: jnp.asarray(np.asarray(values, np.float16), jnp.float32) for name, values in weights.items()}
    inputs = (held.features - mean) / deviation
    for view, title in enumerate(["whole", "four grounds", "four grounds and electrodes", "floor"]):
        report(weights, held, inputs, np.flatnonzero(held.view == view), title)
    save(args.out, weights, args, data, mean, deviation, limits_of(weights, held, inputs), time.time() - begin)


if __name__ == "__main__":
    main()
