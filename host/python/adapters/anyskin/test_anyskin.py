import inspect
import pathlib
import sys
import time

import numpy as np
import pytest
import tactomo

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from tactomo_anyskin import TactomoSkin


def skin(**options):
    detector = tactomo.Detector().taken_as_exact()
    return TactomoSkin(simulate=True, board="ideal", scene="single", detector=detector, **options)


def test_samples_are_a_time_and_flat_floats():
    reader = skin()
    reader.start()
    try:
        samples = reader.get_data(num_samples=5)
        assert [sample.shape for sample in samples] == [(1 + 256,)] * 5
        times_s = [sample[0] for sample in samples]
        assert times_s == sorted(times_s) and abs(times_s[-1] - time.time()) < 60
        taken_s, floats = reader.get_sample()
        assert floats.shape == (256,) and taken_s > times_s[-1]
        assert reader.sample_cnt >= 6 and reader.last_reading[0] >= taken_s
        reader.pause_streaming()
        assert reader.get_data(2) == []
        reader.start_streaming()
        assert len(reader.get_data(2)) == 2
    finally:
        reader.join()


def test_contacts_are_the_firmest_first_and_zeros_where_there_is_none():
    reader = skin(values="contacts")
    reader.start()
    try:
        for _ in range(2000):
            contacts = reader.get_data(2)[1][1:].reshape(6, 3)
            if contacts[0, 2] > 0:
                break
        assert contacts[0, 2] > 0 and (np.diff(contacts[:, 2]) <= 0).all() and not contacts[5].any()
        assert np.abs(contacts[:, :2]).max() < 0.03
    finally:
        reader.join()


def test_a_buffer_keeps_samples_until_it_is_taken():
    reader = skin()
    reader.start()
    try:
        reader.start_buffering()
        reader.get_data(20)
        assert reader.get_buffer() is None
        samples = reader.get_buffer(pause_if_buffering=True)
        assert len(samples) >= 18 and reader.get_buffer() == []
    finally:
        reader.join()


def test_what_is_wrong_is_raised():
    with pytest.raises(ValueError, match="touch. or .contacts"):
        skin(values="colours")
    with pytest.raises(tactomo.TactomoError, match="/dev/not-there"):
        TactomoSkin("/dev/not-there").start()


def test_it_has_the_methods_of_anyskin():
    anyskin = pytest.importorskip("anyskin")
    theirs = anyskin.AnySkinProcess
    own = [name for name in vars(theirs) if not name.startswith("_") and name != "run"]
    assert {"get_data", "get_buffer", "start_streaming", "last_reading", "sample_cnt"} <= set(own)
    for name in own:
        ours, their = inspect.getattr_static(TactomoSkin, name), inspect.getattr_static(theirs, name)
        assert isinstance(ours, property) == isinstance(their, property), name
        if callable(their):
            assert list(inspect.signature(ours).parameters) == list(inspect.signature(their).parameters), name
    # What a visualisation written for it does: a baseline of five samples, then one after the other.
    reader = skin()
    reader.start()
    time.sleep(0.1)
    baseline = np.mean(np.array(reader.get_data(num_samples=5))[:, 1:], axis=0)
    assert (reader.get_data(num_samples=1)[0][1:] - baseline).shape == (256,)
    reader.pause_streaming()
    reader.join()
