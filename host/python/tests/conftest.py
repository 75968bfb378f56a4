"""What several tests press."""

import signal

import pytest
import tactomo

PRESS = tactomo.Contact(0.009, -0.006, 0.003, 2e-4)


@pytest.fixture(scope="session")
def detector():
    """A detector that is exactly as described, for which nothing unknown has to be reckoned with."""
    return tactomo.Detector("square-60").taken_as_exact()


@pytest.fixture(scope="session")
def model(detector):
    return tactomo.Model(detector)


@pytest.fixture(scope="session")
def simulator(detector):
    return tactomo.Simulator(detector)


@pytest.fixture(scope="session")
def readings(simulator):
    """A light press with the converter's noise (V)."""
    return simulator.readings([PRESS])


@pytest.fixture
def ctrl_c():
    """Python's own answer to SIGINT, which it does not set where it was started with SIGINT ignored, as in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
