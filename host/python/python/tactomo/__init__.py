"""Touch from tomographic tactile sensors: detectors, solvers, live boards, recordings and simulation.

From contacts to readings and back:

>>> import tactomo
>>> detector = tactomo.Detector("square-60")
>>> press = tactomo.Contact(x_m=0.009, y_m=-0.006, radius_m=0.003, conductance_s=2e-4)
>>> readings = tactomo.Simulator(detector).readings([press])
>>> solver = tactomo.Solver("contacts", detector.taken_as_exact())
>>> contact, = solver.solve(readings).contacts
>>> abs(contact.x_m - 0.009) < 1e-3 and abs(contact.y_m + 0.006) < 1e-3
True

Units are SI, and in the names: `_m` metres, `_s` siemens for a conductance and seconds for a time, `_v` volts, `_n` newtons, `_us`
microseconds. Readings are arrays `(n, n)` of volts for `n` electrodes: `readings[g][e]` is electrode `e` while `g` is grounded.
"""

from ._tactomo import (
    CONTACT_FIELDS,
    SCENES,
    SOLVERS,
    Calibration,
    Contact,
    Correction,
    Detector,
    Flags,
    ForceLaw,
    FoundContact,
    Frame,
    Frames,
    Learned,
    Live,
    Mesh,
    Model,
    Raster,
    Recording,
    Shape,
    Simulator,
    Solution,
    Solutions,
    Solver,
    TactomoError,
    Total,
    TouchEvent,
    __version__,
    learn,
)

__all__ = [
    "CONTACT_FIELDS",
    "SCENES",
    "SOLVERS",
    "Calibration",
    "Contact",
    "Correction",
    "Detector",
    "Flags",
    "ForceLaw",
    "FoundContact",
    "Frame",
    "Frames",
    "Learned",
    "Live",
    "Mesh",
    "Model",
    "Raster",
    "Recording",
    "Shape",
    "Simulator",
    "Solution",
    "Solutions",
    "Solver",
    "TactomoError",
    "Total",
    "TouchEvent",
    "__version__",
    "learn",
]
