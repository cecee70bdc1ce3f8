"""Texts of mechanism files, and reading them, for the tests of the room ``mechanism``."""

from pathlib import Path

from monodyn.mechanism import Mechanism, load

GEOM = '<geom type="box" size="0.05 0.0025 0.01" pos="0.05 0 0"/>'


def mjcf(body: str, before: str = '<option gravity="0 0 -9.81"/>') -> str:
    """Return the text of an MJCF file."""
    return f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>"


def body_with(joint: str, inner: str = "", name: str = "a") -> str:
    """Return the text of a body with a joint and a box."""
    return f'<body name="{name}">{joint}{GEOM}{inner}</body>'


HINGE = '<joint name="j1" axis="0 -1 0"/>'
SINGLE = body_with(HINGE)

URDF = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="0.3"/>
<inertia ixx="1e-3" iyy="2e-3" izz="2e-3" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0.1 0 0"/><geometry><box size="0.2 0.01 0.03"/></geometry><material name="red"/></visual>
<collision><origin xyz="0.1 0 0"/><geometry><box size="0.3 0.05 0.05"/></geometry></collision></link>
<link name="lower"><visual><origin xyz="0 0 -0.1"/>
<geometry><cylinder radius="0.01" length="0.2"/></geometry></visual>
</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 -1 0"/>
<limit lower="-1" upper="2" effort="1" velocity="1"/><dynamics damping="0.01" friction="0.02"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0.2 -0.02 0"/>
<axis xyz="0 -1 0"/></joint>{}</robot>"""


def read(folder: Path, text: str, name: str = "m.xml") -> Mechanism:
    """Write a mechanism file and load it."""
    (folder / name).write_text(text)
    return load(folder / name)


def series_driven(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with a series of two terms, every coefficient another number."""
    driven = mechanism.with_torque("fourier", terms=2, period=0.8)
    names = [name for name in driven.values if ".torque." in name]
    return driven.with_values({name: 0.001 * (k + 1) for k, name in enumerate(names)})


def with_discs(folder: Path, radius: float) -> Mechanism:
    """Return two rods of a radius [m] with a disc at the end of each."""

    def rod(name: str, length: float) -> str:
        return (
            f'<geom type="capsule" size="{radius}" fromto="0 0 0 0 0 -{length}"/>'
            f'<geom name="{name}" type="cylinder" size=".03 .01" pos="0 0 -{length}" euler="1.5707963 0 0"/>'
        )

    outer = f'<body name="link2" pos="0 0 -0.16"><joint name="j2" axis="0 -1 0"/>{rod("tip", 0.11)}</body>'
    inner = f'<body name="link1"><joint name="j1" axis="0 -1 0"/>{rod("elbow", 0.16)}{outer}</body>'
    return read(folder, mjcf(inner, '<compiler angle="radian"/>'), "discs.xml")
