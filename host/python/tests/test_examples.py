"""Parts of the examples that need nothing but numpy; and what needs more, where it is installed."""

import importlib.util
import json
import pathlib

import numpy as np
import pytest
import tactomo

EXAMPLES = pathlib.Path(__file__).parent.parent / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("presses") / "presses.tactomo"
    example("train_network").record(path, 6, 1, tactomo.Detector().taken_as_exact())
    return path


def test_a_data_set_has_the_presses_of_its_recordings(recording):
    network = example("train_network")
    dataset = network.PressDataset([recording, recording], frames_each=3)
    assert len(dataset) == 2 * 6 * 3
    features, place_m = dataset[4]
    assert features.shape == (257,) and place_m.shape == (2,) and features.dtype == place_m.dtype == np.float32
    assert np.linalg.norm(features[:256]) == pytest.approx(1, rel=1e-5)
    # The frames are those of the press that the table tells: the solver finds it there, in the frame with all that it says.
    solver = tactomo.Solver("contacts", tactomo.Recording(recording).detector)
    frames = list(tactomo.Recording(recording).less_baseline())
    told = np.array([network.features(frame.readings) for frame in frames], dtype=np.float32)
    for features, place_m in (dataset[index] for index in range(0, 18, 3)):
        [index] = np.flatnonzero((told == features).all(axis=1))
        [contact] = solver.solve_many([frames[index]])[0].contacts
        assert [contact.x_m, contact.y_m] == pytest.approx(place_m, abs=1e-3)


def test_recordings_without_presses_are_refused(recording):
    table = recording.with_suffix(".csv")
    other = recording.with_name("other.tactomo")
    other.write_bytes(recording.read_bytes())
    lines = table.read_text().splitlines()
    other.with_suffix(".csv").write_text(lines[0] + "\n1e9,1e9,0,0\n")
    with pytest.raises(ValueError, match="no press of the tables"):
        example("train_network").PressDataset([other])


def test_torch_trains_on_the_data_set(recording):
    torch = pytest.importorskip("torch")
    network = example("train_network")
    dataset = network.PressDataset([recording])
    assert isinstance(dataset, torch.utils.data.Dataset)
    found_m = network.train(dataset, epochs=60)
    error_m = np.linalg.norm(found_m(dataset.features) - dataset.places_m, axis=1)
    assert error_m.mean() < 2e-3


def touch_lines(forces_n):
    """None, one and two contacts in turn, on two detectors: lines as of an export."""
    for index, force_n in enumerate(forces_n):
        for patch in ("palm", "thumb"):
            contact = {"x_m": 0.001, "y_m": -0.002, "conductance_s": 1e-4 * (1 + index)}
            contact |= {} if force_n is None else {"force_n": force_n}
            second = contact | {"x_m": 0.002, "conductance_s": 1e-3} | ({} if force_n is None else {"force_n": 3 * force_n})
            contacts = [[], [contact], [contact, second]][index % 3]
            line = {"patch": patch, "arrived_unix_s": 1e9 + index / 100, "contacts": contacts}
            # The palm's scans are 5 ms before they came.
            yield line | ({"host_time_ns": 10**18 + 10**7 * index - 5 * 10**6} if patch == "palm" else {})


@pytest.mark.parametrize("force_n", [2.0, None])
def test_frames_of_a_lerobot_data_set_are_what_its_features_say(tmp_path, force_n):
    file = tmp_path / "touch.jsonl"
    file.write_text("".join(json.dumps(line) + "\n" for line in touch_lines([force_n] * 9)))
    palm, thumb = example("lerobot_dataset").touches(file)
    assert (palm.name, thumb.name, palm.has_newtons) == ("palm", "thumb", force_n is not None)
    for touch in (palm, thumb):
        features, frame = touch.features(), touch.at(10**18 + 20 * 10**6)
        assert features.keys() == frame.keys() and all(name.startswith("observation.tactile.") for name in frame)
        for name, feature in features.items():
            assert (frame[name].shape, frame[name].dtype) == (feature["shape"], np.dtype(feature["dtype"])), name
            assert np.isfinite(frame[name]).all()
    key = "observation.tactile.palm"
    before, after = palm.at(10**18 + 15 * 10**6 - 1), palm.at(10**18 + 15 * 10**6)
    assert [frame[f"{key}.count"][0] for frame in (before, after)] == [1, 2]
    assert before[f"{key}.age_s"][0] == pytest.approx(0.01) and after[f"{key}.age_s"][0] == 0
    points = after[f"{key}.points"]
    assert points[:2, 0] == pytest.approx([0.002, 0.001]) and not points[2:].any(), "the strongest is the first"
    if force_n:
        assert points[:2, 5] == pytest.approx([-6, -2])
        # Torque is place times force: y Fz, -x Fz.
        assert after[f"{key}.wrench"] == pytest.approx([0, 0, -8, 0.016, 0.002 * 6 + 0.001 * 2, 0])
        assert not palm.at(10**18)[f"{key}.wrench"].any()
    else:
        assert points[:2, 3] == pytest.approx([1e-3, 3e-4]) and f"{key}.wrench" not in after
    with pytest.raises(ValueError, match="thumb: the first touch is 1.000 s after a picture"):
        thumb.at(10**18 - 10**9)


def test_touch_that_has_no_frame_is_refused(tmp_path):
    file = tmp_path / "touch.jsonl"
    file.write_text('{"arrived_unix_s": 1, "contacts": [{"x_m": 0, "y_m": 0, "z_m": 0.01}]}\n')
    with pytest.raises(ValueError, match="touch is curved"):
        example("lerobot_dataset").touches(file)
    file.write_text('{"arrived_unix_s": 1, "contacts": [], "rezeroing": true}\n')
    with pytest.raises(ValueError, match="has no touch"):
        example("lerobot_dataset").touches(file)


def test_lerobot_reads_the_data_set_that_the_example_makes(tmp_path, monkeypatch):
    datasets = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    image = pytest.importorskip("PIL.Image")
    (tmp_path / "touch.jsonl").write_text("".join(json.dumps(line) + "\n" for line in touch_lines([2.0] * 60)))
    (tmp_path / "pictures").mkdir()
    for picture in range(12):
        shade = np.full((64, 96, 3), 20 * picture, np.uint8)
        image.fromarray(shade).save(tmp_path / "pictures" / f"{10**18 + 10**9 * picture // 30}.png")
    paths = [str(tmp_path / name) for name in ("touch.jsonl", "pictures", "dataset")]
    monkeypatch.setattr("sys.argv", ["lerobot_dataset.py", *paths, "--fps", "30", "--task", "hold"])
    lerobot_dataset = example("lerobot_dataset")
    lerobot_dataset.main()
    # Its other reader of videos takes a system's FFmpeg.
    dataset = datasets.LeRobotDataset("local/dataset", root=paths[2], video_backend="pyav")
    assert len(dataset) == 12 and dataset.fps == 30
    palm = lerobot_dataset.touches(paths[0])[0]
    for picture in range(12):
        item = dataset[picture]
        for name, value in palm.at(10**18 + 10**9 * picture // 30).items():
            assert np.array_equal(item[name].numpy().reshape(value.shape), value), name
        assert item["observation.images.camera"].shape == (3, 64, 96) and item["task"] == "hold"


def test_a_chunk_of_a_data_set_is_the_same_whoever_makes_it(tmp_path):
    pytest.importorskip("ray")
    cluster = example("cluster")
    one = cluster.chunk(5, 20)
    assert one["readings_v"].shape == (20, 16, 16) and one["contacts"].shape == (20, 3, 4)
    cluster.write(tmp_path, 5, 20)
    with np.load(tmp_path / "frames-000005.npz") as written:
        assert all(np.array_equal(written[name], one[name], equal_nan=True) for name in one)
    assert [path.name for path in tmp_path.iterdir()] == ["frames-000005.npz"]


@pytest.fixture(scope="module")
def pads():
    gripper = example("gripper")
    return gripper, [gripper.Pad("left", 3), gripper.Pad("right", 4)]


def test_a_slip_is_noticed_and_the_grip_raised_until_it_ends(pads):
    gripper, pads = pads
    held = gripper.hold(pads)
    assert held["held"] and held["slid_m"] < 0.015
    # Not before it slides, and within 60 ms of that: eight pairs of pads took 35 to 47.
    assert 0 < held["raised_s"][0] - held["slips_s"] < 0.06
    # What is needed at rest, and less than twice that: raising has ended.
    needed_n = gripper.FULL_KG * gripper.GRAVITY_M_PER_S2 / (2 * gripper.STATIC)
    assert needed_n < held["grip_n"] < 2 * needed_n


def test_without_the_loop_the_cup_falls(pads):
    gripper, pads = pads
    lost = gripper.hold(pads, has_loop=False)
    assert not lost["held"] and lost["slid_m"] > 0.04 and lost["slips_s"] is not None


def test_a_grip_that_is_firm_enough_is_never_raised(pads):
    gripper, pads = pads
    held = gripper.hold(pads, force_n=4.0)
    assert held["held"] and held["raised_s"] == [] and held["slid_m"] == 0


def lines(speed, finger="left", **more):
    """A contact that goes up, at 400 lines a second, told to 0.1 mm."""
    for frame in range(40):
        contact = {"x_m": 0.0, "y_m": speed * frame / 400, "conductance_s": 1e-4, "sigma_x_m": 1e-4, "sigma_y_m": 1e-4}
        time_s = frame / 400
        yield {"patch": finger, "time_s": time_s, "arrived_unix_s": 1e9 + time_s, "contacts": [contact], "flags": {}, **more}


@pytest.mark.parametrize(
    ("left", "right", "is_raised"),
    [
        (lines(0.05), lines(0.05, "right"), True),
        # The other finger stands still, feels nothing, or says nothing.
        (lines(0.05), lines(0.0, "right"), False),
        (lines(0.05), lines(0.05, "right", contacts=[]), False),
        (lines(0.05), [next(lines(0.0, "right", arrived_unix_s=1e9 - 1))] * 40, True),
        # Slower than the standard errors tell, and answers that are not sure.
        (lines(0.003), lines(0.003, "right"), False),
        (lines(0.05, flags={"misfit": True}), lines(0.05, "right"), False),
    ],
)
def test_both_fingers_have_to_slip_for_sure(left, right, is_raised):
    grip = example("gripper").Grip(1.0)
    raised = [grip.take(line) for pair in zip(left, right, strict=True) for line in pair]
    assert any(raised) == is_raised == (grip.force_n > 1.0)
