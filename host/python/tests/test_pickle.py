import copy
import pickle

import numpy as np
import pytest
import tactomo
from conftest import PRESS

# A cylinder's quarter in four facets, 60 mm long and of 30 mm radius.
ANGLES = np.linspace(-np.pi / 4, np.pi / 4, 5)
CALIBRATION = """
[calibration]
date = "2026-01-02"
frames = 900
presses = 150
parameters = ["thickness", "gain:3"]
standard_errors = [0.0125, 0.003]
left_at_prior = ["gain:3"]
directions = [[0.0125, 0.0], [0.0, 0.003]]
"""


def again(thing):
    return pickle.loads(pickle.dumps(thing))


def curved(folder):
    rims = [[(30 * np.sin(angle), y, 30 * np.cos(angle)) for angle in ANGLES] for y in (-30, 30)]
    lines = [f"v {x} {y} {z}" for rim in rims for x, y, z in rim]
    lines += [f"f {i} {i + 1} {i + 6} {i + 5}" for i in range(1, 5)]
    (folder / "quarter.obj").write_text("\n".join(lines))
    places = [[x / 1e3, y, z / 1e3] for x, _, z in rims[0][1:4] for y in (-0.02, 0.0, 0.02)]
    text = f"""
surface = "quarter.obj"
surface_unit = "mm"
[[layers]]
thickness_m = 0.003
conductivity_s_per_m = 0.2273
[electrodes]
positions_m = {[[float(at) for at in place] for place in places]}
diameter_m = 0.002
"""
    path = folder / "quarter.toml"
    path.write_text(text)
    return tactomo.Detector(path)


def test_detectors_come_back_as_they_were():
    plain = tactomo.Detector("display-140x70")
    calibrated = tactomo.Detector.from_toml(tactomo.Detector().to_toml() + CALIBRATION)
    for detector in (plain, plain.as_built(3), calibrated, tactomo.Detector().in_material("BC")):
        assert again(detector) == detector == copy.deepcopy(detector), detector
    assert again(calibrated).calibration.parameters == {"thickness": (0.0125, False), "gain:3": (0.003, True)}


def test_a_curved_detector_brings_its_surface(tmp_path):
    detector = curved(tmp_path)
    (tmp_path / "quarter.obj").unlink()
    back = again(detector)
    # An OBJ file is in its own unit, so that the last bit may differ.
    assert np.allclose(back.electrodes_m, detector.electrodes_m, atol=1e-12) and back.electrodes == 9
    assert back.to_toml().count("quarter.obj") == 1 and back.name == detector.name == "quarter"


def test_contacts_come_back_as_they_were():
    contact = tactomo.Contact(0.1, -0.2, 0.003, 1 / 3, z_m=0.7)
    for back in (again(contact), copy.copy(contact)):
        assert back == contact and back.z_m == 0.7


def same(one, other):
    """Whether two solutions say the same, to the last bit."""
    assert one.array.tobytes() == other.array.tobytes() and repr(one) == repr(other)
    assert [repr(contact) for contact in one.contacts] == [repr(contact) for contact in other.contacts]
    for name in ("residual", "certainty", "alternative", "choice", "calibrated_m", "is_contacts"):
        assert getattr(one, name) == getattr(other, name), name
    assert repr(one.shape) == repr(other.shape) and repr(one.flags) == repr(other.flags)
    assert np.array_equal(one.image, other.image) if one.image is not None else other.image is None
    assert one.to_json() == other.to_json()
    return True


@pytest.mark.parametrize("name", ["auto", "contacts", "tikhonov"])
def test_solutions_come_back_as_they_were(name, readings):
    # A detector that is not known exactly, so that a calibration would tell more.
    solution = tactomo.Solver(name).solve(readings)
    assert same(again(solution), solution) and same(copy.deepcopy(solution), solution)
    contact = solution.contacts[0]
    assert all(getattr(again(contact), field) == getattr(contact, field) for field in tactomo.CONTACT_FIELDS)


@pytest.mark.parametrize("name", ["contacts", "tikhonov"])
def test_solutions_of_many_frames_come_back_as_they_were(name, detector, readings):
    found = tactomo.Solver(name, detector).solve_many([readings, 0 * readings])
    back = again(found)
    assert back.array.tobytes() == found.array.tobytes() and back.flags.tobytes() == found.flags.tobytes()
    assert all(same(one, other) for one, other in zip(back, found, strict=True)) and len(list(back)) == 2
    assert back.images is None or np.array_equal(back.images, found.images)


def test_a_shape_comes_back_as_it_was_and_faults_too(simulator, detector):
    line = {"line": {"length_m": 0.03, "width_m": 0.003, "angle_rad": 0.5}}
    touch = {"centre_m": [0.002, -0.003], "shape": line, "conductance_s": 1e-3}
    solution = tactomo.Solver("auto", detector).solve(simulator.readings([touch]))
    assert solution.shape.kind == "line" and same(again(solution), solution)
    assert repr(again(solution.shape)) == repr(solution.shape)
    broken, solver = tactomo.Simulator(detector, faults=["open:3"]), tactomo.Solver("contacts", detector)
    frames = (solver.solve(broken.readings([PRESS])) for _ in range(1000))
    solution = next(solution for solution in frames if solution.flags.excluded)
    assert solution.flags.excluded == [3] and same(again(solution), solution)
