"""Many frames in one call, and what is found in them for other packages."""

import os
import signal
import threading

import numpy as np
import pytest
import tactomo
from conftest import PRESS


@pytest.fixture(scope="module")
def frames(simulator):
    """Nothing, one contact and two, in turn (V)."""
    other = (-0.012, 0.01, 0.003, 3e-4)
    contacts = ([], [PRESS], [PRESS, other])
    return np.array([simulator.readings(contacts[index % 3]) for index in range(12)])


@pytest.fixture(scope="module")
def found(detector, frames):
    return tactomo.Solver("contacts", detector).solve_many(frames)


def same(one, other):
    return one.array.tobytes() == other.array.tobytes() and repr(one.flags) == repr(other.flags)


@pytest.mark.parametrize("name", ["auto", "contacts", "tikhonov"])
def test_independent_frames_have_the_same_answers_on_any_number_of_cores_and_in_any_order(name, detector, frames):
    solver = tactomo.Solver(name, detector)
    solver.solve(frames[2])
    one, three = solver.solve_many(frames, 1), solver.solve_many(frames, cores=3)
    assert same(one, three) and np.array_equal(one.residual, three.residual, equal_nan=True)
    order = np.random.default_rng(5).permutation(len(frames))
    turned = solver.solve_many(frames[order], 2)
    assert all(same(one[int(index)], there) for index, there in zip(order, turned, strict=True))
    alone = tactomo.Solver(name, detector).solve(frames[7])
    assert same(one[7], alone)
    if one.images is not None:
        assert np.array_equal(one.images, three.images, equal_nan=True) and np.array_equal(one.images[7], alone.image)


def test_frames_in_sequence_are_those_of_solve_one_after_the_other(detector, frames):
    many, single = (tactomo.Solver("contacts", detector) for _ in range(2))
    in_sequence = many.solve_many(frames[1::3], in_sequence=True)
    assert all(same(one, single.solve(frame)) for one, frame in zip(in_sequence, frames[1::3], strict=True))
    # What stands still is known better from frame to frame, and the solver goes on from there.
    sigma_m = in_sequence.array["sigma_x_m"][:, 0]
    assert sigma_m[-1] < 0.8 * sigma_m[0]
    assert same(many.solve(frames[1]), single.solve(frames[1]))


def test_arrays_have_what_the_solutions_have(found, frames):
    assert len(found) == len(frames) == 12 and found.count.tolist() == 4 * [0, 1, 2]
    assert found.array.shape == (12, 2) and found.array.dtype.names == tactomo.CONTACT_FIELDS
    assert np.isnan(found.array["x_m"]).sum(axis=1).tolist() == 4 * [2, 1, 0]
    for index, solution in enumerate(found):
        assert found.array[index, : len(solution.contacts)].tobytes() == solution.array.tobytes()
        assert found.flags["misfit"][index] == solution.flags.misfit
    assert found.array["x_m"][1, 0] == pytest.approx(PRESS.x_m, abs=1e-3)
    assert found.flags.dtype.names == ("saturated", "misfit", "unfinished", "calibrate") and not found.flags["misfit"].any()
    assert np.nanmax(found.residual) < 2 and found.certainty[1] > 0.9 and found.images is None
    assert found.array is found.array and same(found[-1], found[11])
    with pytest.raises(IndexError, match="no frame 12 among 12"):
        found[12]


def test_images_have_a_row_for_each_frame(detector, frames):
    solver = tactomo.Solver("tikhonov", detector)
    images = solver.solve_many(frames).images
    assert images.shape == (12, len(solver.mesh)) and images.dtype == np.float32 and np.isfinite(images).all()


def test_no_frames_are_no_answers(detector):
    none = tactomo.Solver("tikhonov", detector).solve_many(np.empty((0, 16, 16)))
    assert len(none) == 0 and none.count.shape == (0,) and none.array.shape == (0, 0) and none.images is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda frames: frames[0], r"frames x 16 x 16 is needed .*16 x 16: one frame is frames\[numpy.newaxis\]"),
        (lambda frames: frames[:, :15], "frames x 16 x 16 is needed .* 12 x 15 x 16"),
        (lambda frames: frames[None], "1 x 12 x 16 x 16"),
        (lambda frames: [*frames[:2], frames[2][:15, :15]], r"frames\[2\]: readings of 15 electrodes"),
        (lambda frames: 1e3 * frames, "millivolts"),
        (lambda frames: [frames[0], "here"], r"frames\[1\]"),
        (lambda frames: [None], r"frames\[0\]: an array of one number is no frame"),
        (lambda frames: len(frames), "frames: an array or a list is needed"),
    ],
)
@pytest.mark.parametrize("in_sequence", [False, True])
def test_what_are_no_frames_is_refused(change, words, in_sequence, detector, frames):
    with pytest.raises(tactomo.TactomoError, match=words):
        tactomo.Solver("tikhonov", detector).solve_many(change(frames), in_sequence=in_sequence)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_reading_that_is_not_finite_is_named(wrong, detector, frames):
    broken = frames.copy()
    broken[7, 2, 3] = wrong
    with pytest.raises(tactomo.TactomoError, match=r"frames\[7\]: the reading of electrode 3 with electrode 2 grounded is not a finite"):
        tactomo.Solver("tikhonov", detector).solve_many(broken)
    for cores in (0, -1):
        with pytest.raises(tactomo.TactomoError, match="cores: a number of threads from 1"):
            tactomo.Solver("tikhonov", detector).solve_many(frames, cores)


def test_numbers_of_other_types_are_frames_too(detector, frames):
    solver = tactomo.Solver("tikhonov", detector)
    images = solver.solve_many(frames).images
    for other in (frames.reshape(12, 256), frames.tolist(), np.asfortranarray(frames), frames.astype(np.float32)):
        assert np.allclose(solver.solve_many(other).images, images, atol=1e-4 * images.max())


def test_other_threads_run_meanwhile(detector, frames):
    many = np.concatenate(8 * [frames])
    thread = threading.Thread(target=tactomo.Solver("contacts", detector).solve_many, args=(many, 1))
    thread.start()
    counted = 0
    while thread.is_alive():
        counted += 1
    thread.join()
    assert counted > 1000


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("in_sequence", [False, True])
def test_ctrl_c_stops_it(in_sequence, detector, frames):
    solver = tactomo.Solver("nonlinear", detector)
    many = np.concatenate(5000 * [frames])
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        solver.solve_many(many, in_sequence=in_sequence)


def test_a_data_frame_has_a_row_for_each_contact(found, detector, frames):
    pytest.importorskip("pandas")
    table = found.to_pandas()
    assert table.index.names == ["frame", "contact"] and len(table) == found.count.sum()
    assert tuple(table.columns) == tactomo.CONTACT_FIELDS
    assert table.loc[(2, 1), "x_m"] == found.array["x_m"][2, 1]
    kinds = {"id": "Int64", "x_m": "float64", "force_n": "float64", "force_beyond_maximum": "boolean", "state": "string"}
    nothing = tactomo.Solver("contacts", detector).solve_many(np.zeros_like(frames)).to_pandas()
    assert len(nothing) == 0
    for some in (table, nothing):
        assert {name: str(some.dtypes[name]) for name in kinds} == kinds
    assert table.groupby("frame").size().to_dict() == {index: count for index, count in enumerate(found.count) if count}


def test_a_dataset_has_the_axes_of_the_arrays(found, detector, frames):
    pytest.importorskip("xarray")
    dataset = found.to_xarray()
    assert dict(dataset.sizes) == {"frame": 12, "contact": 2} and "image" not in dataset
    assert np.array_equal(dataset["y_m"].values, found.array["y_m"], equal_nan=True)
    assert dataset["count"].values.tolist() == found.count.tolist() and dataset["misfit"].dtype == bool
    images = tactomo.Solver("tikhonov", detector).solve_many(frames).to_xarray()
    assert images["image"].dims == ("frame", "node")
