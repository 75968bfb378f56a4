"""A tactomo sensor behind the interface of AnySkin's reader: samples are a time and flat floats.

`TactomoSkin` has the methods of `anyskin.AnySkinProcess` and `anyskin.AnySkinBase`, so that programs written for these take it as it is:

>>> skin = TactomoSkin(simulate=True)
>>> skin.start()
>>> baseline = skin.get_data(num_samples=5)   # five arrays [time, float, float, ...]
>>> skin.join()

No process of its own is needed: the board is read by threads that hold no lock of the interpreter.
"""

import threading
from collections import deque

import numpy as np
import tactomo

# Samples that a buffer holds at most: a quarter of an hour at 1200 a second would be a million; older ones are left out.
BUFFER = 1 << 20


class TactomoSkin:
    """Reads a board in the background. `values` chooses the floats of a sample:

    - `"touch"`: the readings less the baseline (V), `n * n` of them, row by row;
    - `"contacts"`: for each of six contacts, the firmest first, x and y (m) and conductance (S); zeros where there is none.

    All other arguments are those of `tactomo.Live`, with `port` first.
    """

    CONTACTS = 6

    def __init__(self, port=None, values="touch", solver=None, **options):
        if values not in ("touch", "contacts"):
            raise ValueError(f"values: `touch` or `contacts` is needed, not `{values}`")
        self._values = self._touch if values == "touch" else self._contacts
        # The readings alone need no solver: the fastest will do.
        solver = solver or ("tikhonov" if values == "touch" else "contacts")
        self._live = tactomo.Live(port, solver=solver, **options)
        self._changed = threading.Condition()
        self._is_streaming = self._is_buffering = self._is_over = False
        self._sample = self._error = None
        self._count = 0
        self._buffer = deque(maxlen=BUFFER)
        self._thread = threading.Thread(target=self._run, name="tactomo skin", daemon=True)

    def start(self):
        """Opens the board and starts streaming."""
        self._live.__enter__()
        self._is_streaming = True
        self._thread.start()

    def start_streaming(self):
        """Goes on streaming."""
        self._is_streaming = True

    def pause_streaming(self):
        """Leaves out samples until streaming goes on."""
        with self._changed:
            self._is_streaming = False
            self._changed.notify_all()

    def start_buffering(self, overwrite=False):
        """Keeps all samples from now on; `overwrite` forgets those before."""
        with self._changed:
            if overwrite:
                self._buffer.clear()
            self._is_buffering = True

    def pause_buffering(self):
        """Keeps no more samples."""
        self._is_buffering = False

    def get_buffer(self, timeout=1.0, pause_if_buffering=False):
        """The samples that were kept, which are forgotten then; none while they are being kept, unless that is to pause."""
        with self._changed:
            if self._is_buffering and not pause_if_buffering:
                return None
            self._is_buffering = False
            samples = list(self._buffer)
            self._buffer.clear()
            return samples

    def get_data(self, num_samples=5):
        """So many samples, the newest known one first: arrays `[time, float, float, ...]`, time in seconds since 1970."""
        samples = []
        with self._changed:
            seen = self._count - 1 if self._count else 0
            while len(samples) < num_samples:
                self._changed.wait_for(lambda: self._count > seen or self._is_over or not self._is_streaming)
                if self._error is not None:
                    raise self._error
                if self._is_over or not self._is_streaming:
                    return []
                seen = self._count
                samples.append(self._sample)
        return samples

    def get_sample(self):
        """Time (s since 1970) and floats of the next sample."""
        sample = self.get_data(2)
        if not sample:
            raise tactomo.TactomoError("the board streams no samples")
        return sample[1][0], sample[1][1:]

    @property
    def last_reading(self):
        """The newest sample, `[time, float, float, ...]`; `None` before the first."""
        return self._sample

    @property
    def sample_cnt(self):
        """Samples so far."""
        return self._count

    def join(self, timeout=None):
        """Closes the board."""
        self.pause_buffering()
        self._live.stop()
        if self._thread.is_alive():
            self._thread.join(timeout)

    def _run(self):
        try:
            for event in self._live:
                if self._is_streaming:
                    self._take(np.concatenate(([event.arrived_unix_s], self._values(event))))
        except tactomo.TactomoError as error:
            self._error = error
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def _take(self, sample):
        with self._changed:
            self._sample = sample
            self._count += 1
            if self._is_buffering:
                self._buffer.append(sample)
            self._changed.notify_all()

    @staticmethod
    def _touch(event):
        return event.touch_v.ravel()

    @classmethod
    def _contacts(cls, event):
        floats = np.zeros((cls.CONTACTS, 3))
        found = np.sort(event.array, order="conductance_s")[::-1][: cls.CONTACTS]
        for column, name in enumerate(("x_m", "y_m", "conductance_s")):
            floats[: len(found), column] = found[name]
        return floats.ravel()
