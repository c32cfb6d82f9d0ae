"""Linear-axis drives over CANopen (CiA 301, CiA 402), real and simulated.

The host's side: ``buses`` opens a bus by name, ``listen`` hears what is said there without a word
of its own, and whether another host is on it,
``axis`` brings one drive up over SDO (with ``configure``, ``drive_objects``, ``sdo_client`` and
``scale`` under it), ``pdo`` packs the frames of the cycle, ``cia402`` knows states, words and
codes.

The drives' side: ``simulated`` runs three drives of ``simulation`` as a process of their own, and
``standstill`` is what they agree on with a host that shares their computer.

``firmware_interface/README.md`` says in words what both sides hold to.
"""
