import json
import os
import signal
import threading
import time

import numpy as np
import pytest
import tactomo

# Longest wait for what has to come, however busy the machine is (s).
PATIENCE_S = 60


def live(**options):
    """The simulated board that is as fast as its converter, with a solver of microseconds."""
    options = {"solver": "tikhonov", "board": "ideal", "scene": "rest", **options}
    return tactomo.Live(simulate=True, detector=tactomo.Detector().taken_as_exact(), **options)


def until(run, wanted):
    """The first event that is wanted."""
    end_s = time.monotonic() + PATIENCE_S
    for event in run:
        if wanted(event):
            return event
        assert time.monotonic() < end_s, f"not in {PATIENCE_S} s; {run.notice}"
    raise AssertionError("the run ended")


def test_events_come_in_order_until_the_time_is_over():
    with live(seconds=0.5) as run:
        assert run.summary is None
        events = list(run)
        assert run.detector.electrodes == 16
    assert len(events) > 10 and run.lost == 0
    sequences = [event.sequence for event in events]
    assert sequences == sorted(sequences) and events[-1].time_s - events[0].time_s < 1
    event = events[-1]
    assert event.readings_v.shape == event.touch_v.shape == (16, 16) and event.readings_v.dtype == np.float64
    assert event.solution.image.shape == (2025,) and event.age_us > 0 and event.averaged >= 1
    assert abs(event.arrived_unix_s - time.time()) < PATIENCE_S
    assert event.host_time_ns is not None and event.host_time_error_ns is not None
    assert 0 < event.arrived_unix_s - event.host_time_ns * 1e-9 + event.host_time_error_ns * 1e-9 < PATIENCE_S
    assert run.summary["solved"] >= len(events) and run.summary["solver"] == "tikhonov"
    with pytest.raises(tactomo.TactomoError, match="make another one"), run:
        pass


def test_an_event_is_the_line_of_the_stream():
    with live() as run:
        event = until(run, lambda event: not event.rezeroing)
    line = json.loads(event.to_json())
    assert line["sequence"] == event.sequence and line["time_s"] == event.time_s
    assert line["contacts"] == json.loads(event.solution.to_json())["contacts"]
    assert "readings_v" not in line and "image_s_per_m2" not in line
    full = json.loads(event.to_json(image=True, readings=True))
    assert np.array_equal(np.ravel(full["readings_v"]), event.readings_v.ravel())
    assert np.allclose(full["image_s_per_m2"], event.solution.image, rtol=1e-6)


def test_readings_are_as_measured_and_beside_them_as_used():
    with live(board="esp32") as run:
        event = until(run, lambda event: not event.rezeroing)
    # At rest nothing is above the floor of an ESP32's converters, within two deviations of the noise: all are that bound.
    assert event.readings_v.min() < event.used_v.min()
    is_bound = event.readings_v != event.used_v
    assert is_bound.mean() > 0.5 and np.all(event.used_v[is_bound] > event.readings_v[is_bound])
    line = json.loads(event.to_json(readings=True))
    assert np.array_equal(np.ravel(line["used_v"]), event.used_v.ravel())


def test_a_press_on_the_simulated_detector_is_found_where_it_is():
    def is_there(event):
        return any(np.hypot(contact.x_m - 0.01, contact.y_m + 0.005) < 2e-3 for contact in event.contacts)

    with live(solver="contacts") as run:
        until(run, lambda event: not event.rezeroing)
        run.press([tactomo.Contact(0.01, -0.005, 0.003, 1e-3)])
        event = until(run, is_there)
        assert event.array["conductance_s"].max() == pytest.approx(1e-3, rel=0.3)
        run.press()
        assert until(run, lambda event: not event.contacts).sequence > event.sequence
        run.change_solver("tikhonov")
        until(run, lambda event: event.solution.image is not None)
        run.rezero()
        until(run, lambda event: event.rezeroing)
        with pytest.raises(tactomo.TactomoError, match="only discs"):
            run.press([{"centre_m": [0, 0], "shape": {"ring": {"radius_m": 0.01, "width_m": 0.002}}, "conductance_s": 1e-3}])


def test_who_is_slow_loses_the_oldest_and_is_told_how_many():
    with live(queue=4, seconds=0.5) as run:
        end_s = time.monotonic() + PATIENCE_S
        while run.lost < 100:
            assert time.monotonic() < end_s
            time.sleep(0.01)
        newest = run.newest()
        assert all(event.sequence > newest.sequence for event in run)
    assert run.summary["solved"] >= 100 + run.lost - 100 and run.summary["dropped"] == 0


def test_stop_ends_an_iteration_in_another_thread():
    with live() as run:
        threading.Timer(0.3, run.stop).start()
        assert sum(1 for _ in run) > 0
    assert run.summary["frames"] > 0 and run.next(0.0) is None


def test_what_is_learned_is_kept_for_the_next_time(tmp_path):
    kept = tmp_path / "mine.learned.toml"
    options = {"simulate": True, "as_built": 3, "kept": kept}
    with tactomo.Live(seconds=90, **options) as run:
        while not kept.exists() and run.next(1.0):
            pass
    with tactomo.Live(seconds=10, **options) as run:
        assert sum(1 for _ in run) > 0
    assert run.summary["learned"]["presses"] >= 5
    kept.write_text("nonsense")
    with pytest.raises(tactomo.TactomoError, match=r"mine\.learned\.toml"), tactomo.Live(**options):
        pass


@pytest.fixture
def silent_port():
    """A serial port on which no board answers."""
    if not hasattr(os, "openpty"):
        pytest.skip("a silent board needs a pseudo-terminal")
    board, port = os.openpty()
    yield os.ttyname(port)
    os.close(board)
    os.close(port)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_the_wait_for_a_silent_board(silent_port):
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt), tactomo.Live(silent_port, solver="tikhonov"):
        pass


def test_a_board_that_does_not_answer_fails_where_it_is_opened(silent_port):
    with pytest.raises(tactomo.TactomoError, match=f"{silent_port}: no board said Hello .* is the firmware on it"), tactomo.Live(silent_port, solver="tikhonov"):
        pytest.fail("it has opened")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"scene": "rest"}, "give simulate=True"),
        ({"simulate": True, "scene": "jazz"}, "there is no scene `jazz`"),
        ({"simulate": True, "board": "arduino"}, "there is no simulated board `arduino`; there are ideal, esp32"),
        ({"simulate": True, "faults": ["open"]}, "open"),
        ({"simulate": True, "solver": "jazz"}, "there is no solver `jazz`"),
        ({"simulate": True, "scan": "0,99"}, "99"),
        ({"simulate": True, "average": 3}, "1, 2, 4, 8"),
        ({"simulate": True, "queue": 0}, "room for one"),
        ({"simulate": True, "port": "COM1"}, "one of port, simulate and replay"),
        ({"simulate": True, "seconds": -1.0}, "seconds"),
        ({"simulate": True, "learn": False, "kept": "mine.learned.toml"}, "kept: no detector is learned"),
        ({"replay": "not-there.tactomo"}, "cannot open the recording not-there.tactomo"),
    ],
)
def test_wrong_options_say_what_is_allowed(options, words):
    with pytest.raises(tactomo.TactomoError, match=words):
        tactomo.Live(**options)


def test_a_port_that_is_not_there_fails_where_it_is_opened():
    run = tactomo.Live("/dev/not-there", solver="tikhonov")
    with pytest.raises(tactomo.TactomoError, match="/dev/not-there"), run:
        pytest.fail("it has opened")
    with pytest.raises(tactomo.TactomoError, match="`with` statement"):
        next(tactomo.Live(simulate=True))


def test_a_detector_that_the_board_does_not_fit_fails_where_it_is_opened(tmp_path):
    path = tmp_path / "touch.tactomo"
    with live(record=path, seconds=0.2) as run:
        assert sum(1 for _ in run) > 0
    wrong = tactomo.Live(replay=path, detector=tactomo.Detector("display-140x70").taken_as_exact(), solver="tikhonov")
    words = "scans 16 electrodes, but the detector display-140x70 has 32: choose the detector that is connected with `detector`"
    with pytest.raises(tactomo.TactomoError, match=words), wrong:
        pytest.fail("it has opened")


def test_the_first_event_is_there_once_it_is_open():
    with live() as run:
        assert run.link == "streaming" and run.next(0.0) is not None
