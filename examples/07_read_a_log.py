"""A log without Duoglide: ten lines with the plain mcap package.

Every message is JSON with its schema in the file. Foxglove and PlotJuggler open the same file.
"""

from __future__ import annotations

import json
from pathlib import Path

from mcap.reader import make_reader

import duoglide as dg

machine = dg.Machine.default()
dg.plan(machine, dg.pick_and_place((-41, -80, 295), (-41, 80, 295))).save("plan.mcap")

with Path("plan.mcap").open("rb") as file:
    reader = make_reader(file)
    for attachment in reader.iter_attachments():
        print(f"{attachment.name}: {len(attachment.data)} bytes of {attachment.media_type}")
    highest = max(
        json.loads(message.data)["position"][2]
        for _, _, message in reader.iter_messages(topics=["/motion"])
    )
print(f"the platform rises to {highest:.3f} mm")
assert abs(highest - 320.0) < 2.0  # the corner tolerance
