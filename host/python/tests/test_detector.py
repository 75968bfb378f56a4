import numpy as np
import pytest
import tactomo


def test_presets_have_the_sizes_of_their_names():
    detector = tactomo.Detector("square-60")
    assert detector == tactomo.Detector() and detector.name == "square-60"
    assert detector.size_m == pytest.approx((0.06, 0.06)) and detector.thickness_m == pytest.approx(0.005)
    places = detector.electrodes_m
    assert places.shape == (16, 3) and detector.electrodes == 16
    # Half a pitch of 15 mm from the edges.
    assert places[0] == pytest.approx([-0.0225, -0.0225, 0.0])
    assert set(tactomo.Detector.presets()) >= {"square-60", "display-140x70"}
    assert tactomo.Detector("display-140x70").electrodes == 32


def test_a_file_is_read_back_as_it_was_written(tmp_path):
    detector = tactomo.Detector("square-60").in_material("BC")
    path = tmp_path / "mine.toml"
    path.write_text(detector.to_toml())
    assert tactomo.Detector(path) == detector == tactomo.Detector(str(path))
    assert tactomo.Detector.from_toml(detector.to_toml()) == detector
    assert detector != tactomo.Detector("square-60")


def test_as_built_is_another_detector_of_the_same_electrodes_the_same_for_a_seed():
    told = tactomo.Detector()
    built = told.as_built(7)
    assert built == told.as_built(7) and built != told.as_built(8)
    apart_m = np.linalg.norm(built.electrodes_m - told.electrodes_m, axis=1)
    # Placed within 0.3 mm: four standard deviations.
    assert 0 < apart_m.max() < 4 * 0.3e-3 * np.sqrt(2)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: tactomo.Detector("round"), "there is no preset of that name; choose one of square-60"),
        (lambda: tactomo.Detector("not-there.toml"), "cannot read the detector not-there.toml"),
        (lambda: tactomo.Detector.from_toml("layers = 3"), "layers"),
        (lambda: tactomo.Detector.from_toml(tactomo.Detector().to_toml().replace("bits = 12", "bits = 99")), "line"),
        (lambda: tactomo.Detector().taken_as_exact().as_built(1), "nothing to draw"),
        (lambda: tactomo.Detector().in_material("BX"), "a foam A, B, C or D is needed"),
        (lambda: tactomo.Calibration(tactomo.Detector()), "square-60 is not calibrated"),
    ],
)
def test_what_is_wrong_says_why(make, words):
    with pytest.raises(tactomo.TactomoError, match=words):
        make()
