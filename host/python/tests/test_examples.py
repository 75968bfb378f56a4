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
