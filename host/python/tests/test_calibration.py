import numpy as np
import pytest
import tactomo


# What is left unknown makes the work of a rub: here that is the layers, and where the electrodes are.
KNOWN = "\n[tolerances]\nuneven_share = 0\nelectrodes_m = 1e-3\ngain_share = 0\noffset_lsb = 0\ncontact_impedance_spread = 0\n"


def described():
    return tactomo.Detector.from_toml(tactomo.Detector().to_toml() + KNOWN)


def presses(count, seed):
    """Single contacts anywhere, from light to firm."""
    random = np.random.default_rng(seed)
    places_m = random.uniform(-0.024, 0.024, (count, 2))
    return [tactomo.Contact(x_m, y_m, 0.004, 10 ** random.uniform(-3.5, -2.5)) for x_m, y_m in places_m]


def rub(built, count, seed):
    """Readings of a finger at places that nobody told (V), `(count, n, n)`."""
    board = tactomo.Simulator(built, seed=seed)
    return np.array([board.readings([press]) for press in presses(count, seed)])


def place_error_m(detector, built):
    """Mean error of the firmest contact's place on presses that no calibration saw (m)."""
    board, solver, errors_m = tactomo.Simulator(built, seed=99), tactomo.Solver("contacts", detector.taken_as_exact()), []
    for press in presses(20, 99):
        solver.reset()
        found = max(solver.solve(board.readings([press])).contacts, key=lambda contact: contact.conductance_s)
        errors_m.append(np.hypot(found.x_m - press.x_m, found.y_m - press.y_m))
    return np.mean(errors_m)


def test_a_rub_finds_the_detector_that_was_built(tmp_path):
    told = described()
    built = told.as_built(3)
    steps = []
    calibration = tactomo.Calibration.rub(told, rub(built, 30, 5), presses=12, progress=lambda *step: steps.append(step))
    before_m, after_m = place_error_m(told, built), place_error_m(calibration.detector, built)
    # A minute's rub gives 0.5 mm (docs/calibrate.md); this one is of 12 presses.
    assert after_m < 1e-3 and before_m > 2 * after_m
    assert len(steps) > 1 and all(residual > 0 for _, residual in steps)
    assert calibration.presses == 12 and calibration.touched == (30, 30) and calibration.residual < 2
    assert 0 < calibration.place_error_m < 2e-3 and calibration.left_out == []
    path = tmp_path / "calibrated.toml"
    calibration.detector.save(path)
    read = tactomo.Detector(path).calibration
    assert read.residual is None
    for name, (error, is_prior) in calibration.parameters.items():
        # Four digits are written.
        assert read.parameters[name] == (pytest.approx(error, rel=1e-3), is_prior)
    with pytest.raises(OSError, match="exists"):
        calibration.detector.save(path)


def test_a_rub_stops_when_told_and_says_what_is_wrong():
    told = described()
    frames = rub(told.as_built(3), 40, 6)
    with pytest.raises(tactomo.TactomoError, match="stopped before the end"):
        tactomo.Calibration.rub(told, frames, progress=lambda *_: False)
    with pytest.raises(ZeroDivisionError):
        tactomo.Calibration.rub(told, frames, progress=lambda *_: 1 / 0)
    with pytest.raises(tactomo.TactomoError, match="nothing presses in any of 3 frames"):
        tactomo.Calibration.rub(told, np.zeros((3, 16, 16)))
    with pytest.raises(tactomo.TactomoError, match="there is no frame 40 among 40"):
        tactomo.Calibration.rub(told, frames, known=[(40, 0.0, 0.0)])
