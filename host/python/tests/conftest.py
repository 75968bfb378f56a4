"""What several tests press."""

import pytest
import tactomo

PRESS = tactomo.Contact(0.009, -0.006, 0.003, 2e-4)


@pytest.fixture(scope="session")
def detector():
    """A detector that is exactly as described, for which nothing unknown has to be reckoned with."""
    return tactomo.Detector("square-60").taken_as_exact()


@pytest.fixture(scope="session")
def simulator(detector):
    return tactomo.Simulator(detector)


@pytest.fixture(scope="session")
def readings(simulator):
    """A light press with the converter's noise (V)."""
    return simulator.readings([PRESS])
