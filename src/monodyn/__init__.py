"""A clip of a planar mechanism in, a simulator of it out.

The public names are loaded when they are first used, so that ``import monodyn`` costs next to nothing:

    mechanism = monodyn.load("double.xml")                    # MJCF, URDF or a bundled name
    video = monodyn.read("clip.mp4")
    masks = monodyn.segment(video)                            # streamed: foreground coverage per frame
    scene = monodyn.locate(masks, mechanism)                  # camera, sizes, initial pose
    poses = monodyn.track(masks, scene)                        # joint positions and covariance per frame
    fit = monodyn.identify(poses, scene.mechanism).check()    # parameters and covariance, or advice
    future = monodyn.predict(fit, until=10.0)
    monodyn.report(fit, future, to="run/")
"""

from __future__ import annotations

with open(f"{__path__[0]}/__init__.pyi", encoding="utf-8") as _stub:
    _HOMES = {line.split()[3]: line.split()[1] for line in _stub if line.startswith("from ")}
"""The module that each public name is loaded from, as the stub for type checkers has it."""

__all__ = ["__version__", *sorted(_HOMES)]


def __getattr__(name: str) -> object:
    """Load a public name from the module it lives in."""
    if name == "__version__":
        from importlib.metadata import version

        return version("monodyn")
    if name in _HOMES:
        from importlib import import_module
        from inspect import isfunction

        value = getattr(import_module(_HOMES[name]), name)
        if isfunction(value):
            from monodyn.typed import checked

            value = checked(value)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'monodyn' has no attribute '{name}'; public names: {', '.join(__all__)}.")


def __dir__() -> list[str]:
    """List the public names."""
    return list(__all__)
