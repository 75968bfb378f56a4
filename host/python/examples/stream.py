"""Prints the contacts of a board as they come, until Ctrl-C.

    python stream.py                 # the board on whichever USB serial port answers
    python stream.py /dev/ttyUSB0    # the board on that port
    python stream.py simulated       # without hardware
"""

import sys
import time

import tactomo

port = sys.argv[1] if len(sys.argv) > 1 else None
options = {"simulate": True, "seconds": 3} if port == "simulated" else {"port": port}

shown_s = 0.0
with tactomo.Live(**options) as live:
    try:
        for event in live:
            # Every answer is here, some hundred a second; a person reads a few.
            if time.monotonic() - shown_s < 0.2:
                continue
            shown_s = time.monotonic()
            contacts = ", ".join(
                f"#{contact.id} at {contact.x_m * 1e3:5.1f} {contact.y_m * 1e3:5.1f} mm" for contact in event.contacts
            )
            print(f"{event.time_s:7.2f} s  {contacts or 'nothing'}  ({event.age_us / 1e3:.1f} ms old, {live.lost} lost)")
    except KeyboardInterrupt:
        pass
print(live.summary)
