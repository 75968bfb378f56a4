"""What presses at known places and of known forces teach."""

import itertools
import pickle

import numpy as np
import pytest
import tactomo

TIP_M = 0.008
# Within Hertz's theory, and firm enough to be told to a few per cent.
FORCES_N = np.array([0.3, 0.37, 0.45, 0.53, 0.62, 0.71, 0.8, 0.95])


@pytest.fixture(scope="module")
def places_m():
    side_m = np.linspace(-0.018, 0.018, 4)
    return np.array(list(itertools.product(side_m, side_m)))


@pytest.fixture(scope="module")
def pressed(simulator, places_m):
    """A press of medium firmness at each of the places (V)."""
    return np.array([simulator.readings([(x_m, y_m, 0.004, 1e-3)]) for x_m, y_m in places_m])


@pytest.fixture(scope="module")
def forced(detector, simulator):
    """A ball of each force (V)."""
    balls = (tactomo.Contact.ball(detector, 0.005, -0.004, TIP_M, force_n) for force_n in FORCES_N)
    return np.array([simulator.readings([ball]) for ball in balls])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, detector):
    """A recording of three balls one after the other, each held and lifted."""
    path = tmp_path_factory.mktemp("known") / "presses.tactomo"
    balls = [tactomo.Contact.ball(detector, x_m, 0.002, TIP_M, force_n) for x_m, force_n in [(-0.01, 0.5), (0.0, 0.7), (0.012, 0.9)]]
    options = {"board": "ideal", "scene": "rest", "solver": "tikhonov", "detector": detector}
    with tactomo.Live(simulate=True, record=path, **options) as live:

        def hold(is_touched, seconds):
            """Waits until something touches or nothing does, and for so long of the board's time."""
            begin = next(event for event in live if not event.rezeroing and bool(event.contacts) == is_touched)
            next(event for event in live if event.time_s > begin.time_s + seconds)

        hold(False, 0.5)
        for ball in balls:
            live.press([ball])
            hold(True, 0.5)
            live.press()
            hold(False, 0.3)
    return tactomo.Recording(path)


def test_known_places_correct_what_runs_smoothly(detector, pressed, places_m):
    # The sheet lies a millimetre beside the sensor.
    off_m = np.array([1e-3, -0.5e-3])
    correction = tactomo.Correction.of_presses(detector, pressed, places_m + off_m)
    assert correction.corrects_places and correction.corrects_conductances is None
    assert correction.before_m.shape == (16,) and np.median(correction.before_m) == pytest.approx(np.hypot(*off_m), rel=0.1)
    assert correction.left_out_m.mean() < 0.3e-3 and correction.skipped == [] and correction.kept == 0
    (contact,) = tactomo.Solver("contacts", correction.detector).solve(pressed[6]).contacts
    assert [contact.x_m, contact.y_m] == pytest.approx(places_m[6] + off_m, abs=0.3e-3)
    # The next sheet counts with this one.
    assert tactomo.Correction.of_presses(correction.detector, pressed[:4], places_m[:4] + off_m).kept == 16


def test_places_that_are_right_need_no_correction(detector, pressed, places_m):
    correction = tactomo.Correction.of_presses(detector, pressed, places_m)
    assert not correction.corrects_places and correction.before_m.mean() < 0.3e-3


def test_known_forces_are_a_law_by_which_contacts_carry_newtons(detector, simulator, forced, tmp_path):
    law = tactomo.ForceLaw.of_presses(detector, forced, FORCES_N)
    exponent, deviation = law.parameters["exponent"]
    # A film under a ball: 5/3.
    assert exponent == pytest.approx(5 / 3, abs=max(0.2, 3 * deviation)) and law.scatter < 0.1 and len(law.left_out) <= 1
    assert law.detector.has_newtons and not detector.has_newtons and law.law in ("power", "saturating")
    path = tmp_path / "newtons.toml"
    law.detector.save(path)
    ball = tactomo.Contact.ball(detector, -0.01, 0.012, TIP_M, 0.8)
    (contact,) = tactomo.Solver("contacts", tactomo.Detector(path)).solve(simulator.readings([ball])).contacts
    assert contact.force_n == pytest.approx(0.8, abs=3 * contact.force_deviation_n) and contact.force_n == pytest.approx(0.8, rel=0.15)
    forced_twice = np.concatenate([forced, forced])
    both = tactomo.ForceLaw.of_presses(detector, forced_twice, np.tile(FORCES_N, 2), unloading=np.repeat([False, True], 8))
    assert both.hysteresis < 0.05


def test_presses_of_a_recording_are_found_in_their_order(detector, recorded):
    frames = list(recorded.less_baseline())
    places_m = np.array([[-0.01, 0.002], [0.0, 0.002], [0.012, 0.002]])
    correction = tactomo.Correction.of_presses(recorded.detector, frames, places_m)
    assert correction.before_m.shape == (3,) and correction.before_m.max() < 2e-3
    with pytest.raises(tactomo.TactomoError, match="3 presses are found, but 2 places are given"):
        tactomo.Correction.of_presses(recorded.detector, frames, places_m[:2])
    # Three are too few for a law, whichever way they are told.
    with pytest.raises(tactomo.TactomoError, match="3 presses, but 4 at least are needed"):
        tactomo.ForceLaw.of_presses(recorded.detector, iter(frames), [0.5, 1.0, 2.0])
    time_s = np.array([frame.time_s for frame in frames])
    with pytest.raises(tactomo.TactomoError, match="no single contact while the force sensor was pressed"):
        tactomo.ForceLaw.of_presses(recorded.detector, frames, np.ones(len(time_s)), time_s=time_s + 1000)


def test_known_presses_say_what_is_wrong(detector, forced, pressed, places_m):
    refused = pytest.raises
    with refused(tactomo.TactomoError, match=r"places_m\[3\]: .* is not on the sensor"):
        tactomo.Correction.of_presses(detector, pressed, np.where(np.arange(16)[:, None] == 3, 20.0, places_m))
    with refused(tactomo.TactomoError, match=r"places_m\[0\]: NaN, .* is not on the sensor"):
        tactomo.Correction.of_presses(detector, pressed, np.full((16, 2), np.nan))
    for wrong, words in {
        "here": "places_m: numbers are needed: could not convert",
        (1.0, 2.0): r"places_m: an array \(presses, 2\) is needed, .* but it is one of 2$",
        ((0, 0, 0),): r"places_m: an array \(presses, 2\) is needed, .* 1 x 3$",
    }.items():
        with refused(tactomo.TactomoError, match=words):
            tactomo.Correction.of_presses(detector, pressed, wrong)
    with refused(tactomo.TactomoError, match="force_n: a list of numbers is needed, but it is an array of 8 x 1"):
        tactomo.ForceLaw.of_presses(detector, forced, FORCES_N[:, None])
    with refused(tactomo.TactomoError, match="places_m: 15 are given, but 16 frames"):
        tactomo.Correction.of_presses(detector, pressed, places_m[:15])
    with refused(tactomo.TactomoError, match="no law of force"):
        tactomo.Correction.of_presses(detector, pressed, places_m, force_n=np.ones(16))
    with refused(tactomo.TactomoError, match="force_n: 7 are given, but 8 frames"):
        tactomo.ForceLaw.of_presses(detector, forced, FORCES_N[:7])
    with refused(tactomo.TactomoError, match=r"force_n\[2\]: a force above zero"):
        tactomo.ForceLaw.of_presses(detector, forced, np.where(np.arange(8) == 2, -1, FORCES_N))
    with refused(tactomo.TactomoError, match=r"force_n\[1\]: its press, of 0.37 N, is too light to be found"):
        tactomo.ForceLaw.of_presses(detector, np.where(np.arange(8)[:, None, None] == 1, 0, forced), FORCES_N)
    with refused(tactomo.TactomoError, match="unloading: as many values as forces"):
        tactomo.ForceLaw.of_presses(detector, forced, FORCES_N, unloading=[True])
    with refused(tactomo.TactomoError, match="law: `power` or `saturating`"):
        tactomo.ForceLaw.of_presses(detector, forced, FORCES_N, law="linear")
    with refused(tactomo.TactomoError, match="frames of a Recording are needed"):
        tactomo.ForceLaw.of_presses(detector, forced, FORCES_N, time_s=np.arange(8))


@pytest.fixture(scope="module")
def learned(detector, simulator):
    random = np.random.default_rng(3)
    places_m, conductances_s = random.uniform(-0.022, 0.022, (120, 2)), 10 ** random.uniform(-3.5, -2.5, 120)
    readings = [simulator.readings([(*place_m, 0.004, conductance_s)]) for place_m, conductance_s in zip(places_m, conductances_s, strict=True)]
    return tactomo.learn(np.array(readings), places_m, detector=detector, conductance_s=conductances_s)


def test_what_presses_teach_is_used_by_a_solver(learned, detector, readings):
    solver = tactomo.Solver(detector=detector, learned=learned)
    assert solver.name == learned.solver == "kernel" and learned.presses == 120 and learned.channels == 256
    assert 0 < learned.left_out_m < 2e-3 < 5e-3 < learned.middle_m and learned.strength == "conductance_s"
    (contact,) = solver.solve(readings).contacts
    assert [contact.x_m, contact.y_m] == pytest.approx([0.009, -0.006], abs=3 * learned.left_out_m)
    # It is not what simulated presses teach.
    assert contact.x_m != tactomo.Solver("kernel", detector).solve(readings).contacts[0].x_m
    many = solver.solve_many(readings[None])
    assert many.array["x_m"][0, 0] == contact.x_m
    with pytest.raises(tactomo.TactomoError, match="for the solver kernel, not auto"):
        tactomo.Solver("auto", detector, learned=learned)
    with pytest.raises(tactomo.TactomoError, match="256 readings a press, but a detector with 32"):
        tactomo.Solver(detector=tactomo.Detector("display-140x70"), learned=learned)


def test_what_was_learned_is_kept(learned, detector, readings, tmp_path):
    path = tmp_path / "mine.safetensors"
    learned.save(path)
    answers = [one.solve(readings.ravel()).array.tobytes() for one in (learned, tactomo.Learned(path), pickle.loads(pickle.dumps(learned)))]
    assert len(set(answers)) == 1
    with pytest.raises(OSError, match="exists"):
        learned.save(path)
    path.write_bytes(b"once upon a time")
    with pytest.raises(tactomo.TactomoError, match=r"cannot use .*mine\.safetensors"):
        tactomo.Learned(path)


def test_a_live_board_is_read_by_what_was_learned(learned, detector):
    with tactomo.Live(simulate=True, detector=detector, board="ideal", scene="single", learned=learned, seconds=1) as live:
        events = list(live)
    assert live.summary["solver"] == "kernel" and len(events) > 10


def test_any_sensor_can_be_learned():
    random = np.random.default_rng(4)
    places_m, ears_m = random.uniform(-0.02, 0.02, (200, 2)), random.uniform(-0.02, 0.02, (7, 2))
    heard = 1e-3 / (1e-2 + np.linalg.norm(places_m[:, None] - ears_m, axis=2))
    learned = tactomo.learn(heard[:150], places_m[:150])
    found_m = np.array([[solution.contacts[0].x_m, solution.contacts[0].y_m] for solution in map(learned.solve, heard[150:])])
    assert np.linalg.norm(found_m - places_m[150:], axis=1).mean() < 2e-3 and learned.strength is None
    with pytest.raises(tactomo.TactomoError, match="6 readings, but it has learned from 7 channels"):
        learned.solve(heard[0, :6])
    with pytest.raises(tactomo.TactomoError, match="10 at least are needed"):
        tactomo.learn(heard[:5], places_m[:5])
    with pytest.raises(tactomo.TactomoError, match="one of force_n, depth_m"):
        tactomo.learn(heard, places_m, force_n=np.ones(200), depth_m=np.ones(200))
    with pytest.raises(tactomo.TactomoError, match=r"places_m: an array \(presses, 2\) or \(presses, 3\) .* 200 x 1$"):
        tactomo.learn(heard, places_m[:, :1])
