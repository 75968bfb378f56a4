"""Two fingers that feel an object slip and grip it firmer: a control loop over nothing but the stream of contacts.

    python gripper.py                 # a cup is filled between two simulated fingers, with the loop and without it
    tactomo live --body host/examples/bodies/gripper.toml --no-open --stream - | python gripper.py -
                                      # the same loop on two boards, or whatever the body has: your gripper's command goes where it prints

The loop is `Grip`: it takes lines of `--stream` and gives the force to grip with (N). A finger slips where its contact moves faster than chance, in
standard errors of the speed; both have to agree. What slips must have an edge or a curve to it: a smooth wall wider than the pad moves no contact.

The simulated pads are not quite as described, of a finer model than solvers invert, and rubbed once, as one would. The cup rests on a stud of 5 mm
radius at each finger. The foam shears below it as a spring (Mindlin), and the stud slides where the shear is more than dry friction holds.
How foam creeps and gives way late is left out.
"""

import json
import math
import sys
import warnings
from collections import deque

import numpy as np
import tactomo

# %% The loop.
# A speed is that of the last so many seconds, and has to be so many standard errors from zero.
WINDOW_S, DEVIATIONS = 0.05, 4
# Each time that the fingers slip, grip is raised by this share, up to the strongest (N); then the gripper has this time to follow (s).
RAISE, STRONGEST_N, FOLLOW_S = 0.3, 10.0, 0.03
# A finger whose stream is silent for so long (s) is not asked: the other decides alone.
SILENT_S = 0.2


class Finger:
    """How fast the contact on one pad moves."""

    def __init__(self):
        # Time (s), x and y (m), and variances of both (m²).
        self.places = deque()
        self.heard_s = -math.inf

    def take(self, line):
        self.heard_s = line["arrived_unix_s"]
        place = centre(line)
        if place is None:
            if not line["contacts"]:
                self.places.clear()
            return
        self.places.append((line["time_s"], *place))
        while self.places[0][0] < line["time_s"] - WINDOW_S:
            self.places.popleft()

    def speed(self):
        """Speed (m/s), and by how many standard errors it is not zero: lines through x and y against time, by least squares."""
        # A contact that has just come settles on the pad.
        if len(self.places) < 5 or self.places[-1][0] - self.places[0][0] < 0.8 * WINDOW_S:
            return 0.0, 0.0
        time_s, x_m, y_m, *variances_m2 = np.array(self.places).T
        leverage = (time_s - time_s.mean()) / ((time_s - time_s.mean()) ** 2).sum()
        speeds = [leverage @ along for along in (x_m, y_m)]
        errors = [math.sqrt(leverage**2 @ variance) for variance in variances_m2]
        return math.hypot(*speeds), math.hypot(*(speed / error for speed, error in zip(speeds, errors, strict=True)))


def centre(line):
    """Where the pad is pressed, x and y (m), with their variances (m²): contacts weighed by their conductance, so that one told as two is one.
    `None` where nothing is, or the answer is not sure."""
    flags = line.get("flags", {})
    contacts = [contact for contact in line["contacts"] if "sigma_x_m" in contact]
    if not contacts or line.get("rezeroing") or flags.get("misfit") or flags.get("unfinished"):
        return None
    weights = np.array([contact["conductance_s"] for contact in contacts])
    weights /= weights.sum()
    of = lambda name: np.array([contact[name] for contact in contacts])
    places = [weights @ of(name) for name in ("x_m", "y_m")]
    variances = [weights**2 @ of(name) ** 2 for name in ("sigma_x_m", "sigma_y_m")]
    return *places, *variances


class Grip:
    """The force to grip with (N), from what both fingers feel."""

    def __init__(self, force_n):
        self.force_n = force_n
        self.fingers = {}
        self.raised_s = -math.inf

    def take(self, line):
        """Takes a line of the stream; whether the grip was raised."""
        self.fingers.setdefault(line["patch"], Finger()).take(line)
        now_s = line["arrived_unix_s"]
        asked = [finger for finger in self.fingers.values() if now_s - finger.heard_s < SILENT_S]
        slips = all(finger.speed()[1] > DEVIATIONS for finger in asked)
        if not slips or now_s - self.raised_s < FOLLOW_S or self.force_n == STRONGEST_N:
            return False
        self.force_n = min((1 + RAISE) * self.force_n, STRONGEST_N)
        self.raised_s = now_s
        return True


# %% What is gripped.
FRAMES_PER_S = 400
STEPS = 10  # of the cup's motion in a frame
GRAVITY_M_PER_S2 = 9.81
STUD_M = 0.005
# Foam B of the paper. A stud sinks further into 5 mm of it than Hertz's theory is for, which is as good as is needed here.
FOAM, YOUNG_PA, POISSON = "B", 0.96e6, 0.3
warnings.filterwarnings("ignore", ".* beyond Hertz's theory")
# Dry friction of the stud on the foam's skin, at rest and sliding: of rubber on plastic, about.
STATIC, SLIDING = 0.6, 0.5
# Time in which the gripper follows its command (s), and the share of critical damping of the sheared foam.
LAG_S, DAMPING = 0.03, 0.3
# The cup (kg) is filled from one time to another (s).
EMPTY_KG, FULL_KG, FILLED_S = 0.1, 0.4, (0.3, 1.8)
LASTS_S = 2.5


class Cup:
    """A cup between two fingers: how far it has moved down (m), and how far of that it has slid."""

    def __init__(self, grip_n):
        self.grip_n = grip_n
        self.down_m, self.slid_m, self.speed = 0.0, 0.0, 0.0
        self.slips = False

    def step(self, time_s, command_n, lasts_s):
        filled = np.interp(time_s, FILLED_S, (0, 1))
        mass_kg = EMPTY_KG + filled * (FULL_KG - EMPTY_KG)
        self.grip_n += (command_n - self.grip_n) * lasts_s / LAG_S
        # Mindlin's shear stiffness of a round contact (N/m), 8 a G / (2 - nu), at both fingers; a is Hertz's radius (m).
        radius_m = (0.75 * self.grip_n * STUD_M * (1 - POISSON**2) / YOUNG_PA) ** (1 / 3)
        stiffness = 2 * 8 * radius_m * YOUNG_PA / (2 * (1 + POISSON)) / (2 - POISSON)
        sheared_m = self.down_m - self.slid_m
        holds_n = 2 * self.grip_n * (SLIDING if self.slips else STATIC)
        self.slips = stiffness * sheared_m > holds_n
        if self.slips:
            # What friction does not hold slides, and the foam stays sheared by what it does.
            self.slid_m = self.down_m - 2 * self.grip_n * SLIDING / stiffness
            friction_n = 2 * self.grip_n * SLIDING
        else:
            friction_n = stiffness * sheared_m + 2 * DAMPING * math.sqrt(stiffness * mass_kg) * self.speed
        self.speed += (GRAVITY_M_PER_S2 - friction_n / mass_kg) * lasts_s
        self.down_m += self.speed * lasts_s


class Pad:
    """A simulated finger's pad: what a board reads, and the detector that a rub has found of it."""

    def __init__(self, name, seed, detector="square-60"):
        self.name = name
        described = tactomo.Detector(detector).in_material(FOAM)
        self.built = described.as_built(seed)
        self.board = tactomo.Simulator(self.built, seed=seed)
        reach_m = 0.85 * np.array(self.built.size_m) / 2
        way = reach_m * np.sin(np.linspace(0, 2 * np.pi, 400)[:, None] * (7.3, 5.1) + (0, 0.5))
        rub = [self.board.readings([tactomo.Contact.ball(self.built, x_m, y_m, 0.006, 3.0)]) for x_m, y_m in way]
        self.detector = tactomo.Calibration.rub(described, np.array(rub)).detector
        self.begin()

    def begin(self):
        """Lets the solver forget what it has felt."""
        self.solver = tactomo.Solver("contacts", self.detector)

    def line(self, time_s, cup, top_m=0.015):
        """What `--stream` would say of a frame in which the stud is so far down."""
        y_m = top_m - cup.down_m
        is_on = y_m > -self.built.size_m[1] / 2
        studs = [tactomo.Contact.ball(self.built, 0.0, y_m, STUD_M, cup.grip_n)] if is_on else []
        solution = json.loads(self.solver.solve(self.board.readings(studs)).to_json())
        return {"patch": self.name, "time_s": time_s, "arrived_unix_s": time_s, **solution}


def hold(pads, force_n=1.5, has_loop=True, tell=lambda text: None):
    """Fills the cup between two pads: figures of how that went."""
    cup, grip = Cup(force_n), Grip(force_n)
    slips_s, raised_s = None, []
    for pad in pads:
        pad.begin()
    for frame in range(int(LASTS_S * FRAMES_PER_S)):
        time_s = frame / FRAMES_PER_S
        # The command that was given by the frame before.
        command_n = grip.force_n if has_loop else force_n
        for step in range(STEPS):
            cup.step(time_s + step / STEPS / FRAMES_PER_S, command_n, 1 / FRAMES_PER_S / STEPS)
        if cup.slid_m > 0 and slips_s is None:
            slips_s = time_s
            tell(f"{time_s:6.3f} s  the cup begins to slide")
        lines = [pad.line(time_s, cup) for pad in pads]
        if not any(line["contacts"] for line in lines) and cup.down_m > 0.03:
            tell(f"{time_s:6.3f} s  it has fallen out")
            break
        for line in lines:
            if grip.take(line) and has_loop:
                raised_s.append(time_s)
                speeds = ", ".join(f"{finger.speed()[0] * 1e3:.0f}" for finger in grip.fingers.values())
                tell(f"{time_s:6.3f} s  slip: contacts move with {speeds} mm/s; grip raised to {grip.force_n:.2f} N")
    is_held = abs(cup.speed) < 1e-3 and not cup.slips
    tell(f"{time_s:6.3f} s  {'held' if is_held else 'lost'}: {cup.slid_m * 1e3:.1f} mm slid, grip {cup.grip_n:.2f} N")
    return {"held": is_held, "slips_s": slips_s, "raised_s": raised_s, "slid_m": cup.slid_m, "grip_n": cup.grip_n}


# %% Boards, through lines on stdin.
def follow(lines, force_n=1.5):
    grip = Grip(force_n)
    for line in map(json.loads, lines):
        if grip.take(line):
            print(f"{line['time_s']:8.3f} s  slip: grip with {grip.force_n:.2f} N", flush=True)


if __name__ == "__main__":
    if sys.argv[1:] == ["-"]:
        follow(sys.stdin)
    else:
        print("rubbing both pads")
        pads = [Pad("left", 3), Pad("right", 4)]
        for has_loop in (True, False):
            print(f"\n{'with' if has_loop else 'without'} the loop")
            hold(pads, has_loop=has_loop, tell=print)
