"""Tracked motion in, identified mechanism out.

Import from the modules: ``identify``, ``settings``, ``fit``, ``smooth``, ``records``. Nothing is
imported here, because the kernels take their time.
"""
