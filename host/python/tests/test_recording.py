import itertools

import numpy as np
import pytest
import tactomo


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Half a second of the simulated board under a steady press, after it was at rest."""
    path = tmp_path_factory.mktemp("recording") / "touch.tactomo"
    detector = tactomo.Detector().taken_as_exact()
    options = {"board": "ideal", "scene": "rest", "solver": "tikhonov", "detector": detector}
    with tactomo.Live(simulate=True, record=path, **options) as live:
        list(itertools.islice((event for event in live if not event.rezeroing), 50))
        live.press([tactomo.Contact(0.01, -0.005, 0.003, 1e-3)])
        list(itertools.islice((event for event in live if event.contacts), 50))
    return path


def test_a_recording_has_frames_and_its_detector(path):
    recording = tactomo.Recording(path)
    frames = list(recording)
    assert len(frames) > 100 and recording.header["detector"] == recording.detector.name == "square-60"
    assert recording.damage() is None and "simulated" in recording.header["source"]
    assert frames[0].time_s == 0 and all(one.time_s < other.time_s for one, other in itertools.pairwise(frames))
    assert all(one.sequence + 1 + other.lost_before == other.sequence for one, other in itertools.pairwise(frames))
    arrays = recording.arrays()
    assert arrays["readings_v"].shape == (len(frames), 16, 16)
    assert np.array_equal(arrays["readings_v"], [frame.readings_v for frame in frames])
    assert np.array_equal(arrays["used_v"], [frame.readings for frame in frames])
    assert np.array_equal(arrays["sequence"], [frame.sequence for frame in frames])
    assert np.array_equal(arrays["time_s"], [frame.time_s for frame in frames])


def test_a_recording_is_a_dataset_with_times(path):
    pytest.importorskip("xarray")
    recording = tactomo.Recording(path)
    dataset, arrays = recording.to_xarray(), recording.arrays()
    assert dataset["readings_v"].dims == ("frame", "ground", "electrode") and dataset["time_s"].dims == ("frame",)
    assert np.array_equal(dataset["used_v"].values, arrays["used_v"])
    in_the_middle = dataset.where(dataset["time_s"] > arrays["time_s"][10], drop=True)
    assert in_the_middle.sizes["frame"] == len(arrays["time_s"]) - 11


def test_a_recording_is_solved_in_one_call(path):
    recording = tactomo.Recording(path)
    found = tactomo.Solver("contacts", recording.detector).solve_many(recording.less_baseline(), in_sequence=True)
    solver = tactomo.Solver("contacts", recording.detector)
    assert all(one.array.tobytes() == solver.solve(frame).array.tobytes() for one, frame in zip(found, recording.less_baseline(), strict=True))


def test_a_recording_is_solved_less_its_baseline(path):
    recording = tactomo.Recording(path)
    solver = tactomo.Solver("contacts", recording.detector)
    *_, last = (solver.solve(frame) for frame in recording.less_baseline())
    (contact,) = last.contacts
    assert np.hypot(contact.x_m - 0.01, contact.y_m + 0.005) < 5e-4
    raw, rest = list(recording), list(recording.less_baseline(rest=20))
    mean_v = np.mean([frame.readings for frame in raw[:20]], axis=0)
    assert len(rest) == len(raw) - 20
    # Less the mean, but for what a converter that gives nothing below zero has hidden of it: less than two codes.
    assert np.allclose(rest[0].readings, raw[20].readings - mean_v, atol=1.6e-3)
    assert np.array_equal(solver.solve(rest[-1]).array.shape, solver.solve(rest[-1].readings).array.shape)


def test_a_replay_gives_the_readings_of_the_recording(path):
    frames = {frame.sequence: frame.readings_v for frame in tactomo.Recording(path)}
    with tactomo.Live(replay=path, speed=float("inf"), solver="tikhonov") as live:
        events = list(live)
    assert len(events) == len(frames) and live.lost == 0
    assert all(np.array_equal(event.readings_v, frames[event.sequence]) for event in events)


def test_what_is_damaged_or_no_recording_says_so(path, tmp_path):
    cut = tmp_path / "cut.tactomo"
    cut.write_bytes(path.read_bytes()[:-7])
    recording = tactomo.Recording(cut)
    assert "cut off" in recording.damage() and len(list(recording)) > 100
    text = tmp_path / "readings.csv"
    text.write_text("1,2,3,4\n")
    with pytest.raises(tactomo.TactomoError, match="readings.csv is not a recording of tactomo"):
        tactomo.Recording(text)
    with pytest.raises(tactomo.TactomoError, match="cannot open the recording .*nowhere"):
        tactomo.Recording(tmp_path / "nowhere")
    with pytest.raises(tactomo.TactomoError, match="the board scans 16 electrodes, but the detector display-140x70 has 32"):
        tactomo.Recording(path, tactomo.Detector("display-140x70"))
    with pytest.raises(tactomo.TactomoError, match="touch.tactomo"), tactomo.Live(simulate=True, record=path):
        pass
