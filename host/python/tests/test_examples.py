"""Parts of the examples that need nothing but numpy; and what needs more, where it is installed."""

import importlib.util
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
    # The frames are those of the press that the table tells: the solver finds it there.
    solver = tactomo.Solver("contacts", tactomo.Recording(recording).detector)
    for features, place_m in (dataset[index] for index in range(0, 18, 3)):
        readings = (features[:256] * np.exp(features[256])).astype(float)
        (contact,) = solver.solve_many([readings])[0].contacts
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
