"""Tracked motion in, identified mechanism out.

Import from the modules: ``identify``, ``settings``, ``fit`` and those of the folders ``record``,
``shooting``, ``torque`` and ``verdict``. Nothing is imported here, because loading the kernels takes time.
"""
