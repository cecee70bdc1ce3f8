"""Ten mechanisms as MJCF text, between them every joint, geom and option that the planar dynamics know."""

HEAD = '<mujoco><option gravity="0 0 -9.81" integrator="RK4" timestep="0.002"/><worldbody>'
TAIL = "</worldbody></mujoco>"
HINGE = '<joint name="{}" type="hinge" axis="{}" damping="{}"/>'


def _link(name: str, joint: str, pos: str, inner: str = "", damping: float = 1e-3) -> str:
    return (
        f'<body name="{name}" pos="{pos}">'
        + HINGE.format(joint, "0 -1 0", damping)
        + f'<geom type="box" size="0.06 0.003 0.012" pos="0.05 0 0" density="2700"/>{inner}</body>'
    )


_CHAIN = (
    '<body name="a" pos="0.1 0 0.3">'
    '<joint name="ja" axis="0 -1 0" damping="0.002" armature="2e-4" stiffness="0.03" springref="20" '
    'ref="10"/>'
    '<geom type="box" size="0.08 0.004 0.01" pos="0.07 0 0.01" density="2700"/>'
    '<body name="b" pos="0.15 -0.01 0.02" euler="0 30 0">'
    '<joint name="jb" axis="0 1 0" pos="0.01 0 -0.005" damping="0.001" armature="1e-4" range="-170 170"/>'
    '<geom name="arm" type="box" size="0.05 0.004 0.01" pos="0.06 0 0" density="2700"/>'
    '<geom name="bar" type="box" size="0.03 0.002 0.006" pos="0.1 0 0.02" euler="0 40 0" density="7800"/>'
    '<body name="c" pos="0.12 -0.01 0">'
    '<joint name="jc" axis="0 -2 0" damping="0.0005" stiffness="0.01"/>'
    '<geom type="capsule" size="0.006" fromto="-0.02 0 0 0.09 0 0.03" density="2700"/>'
    "</body></body></body>"
)

_SHAPES = (
    '<asset><mesh name="wedge" vertex="0 -.01 -.02  0 .01 -.02  0 -.01 .02  0 .01 .02  .12 -.005 0  .12 '
    '.005 .01"/></asset>'
    "<worldbody>"
    '<body name="a"><joint name="ja" axis="0 -1 0" damping="0.001"/>'
    '<inertial pos="0.07 0.002 0.004" mass="0.12" diaginertia="2e-4 3e-4 2.5e-4"/>'
    '<geom type="capsule" size="0.01" fromto="0 0 0 0.15 0 0"/>'
    '<geom type="cylinder" size="0.02 0.004" pos="0.05 0 0" euler="90 0 0"/>'
    '<body name="b" pos="0.15 -0.02 0"><joint name="jb" axis="0 -1 0" damping="0.001"/>'
    '<geom type="cylinder" size="0.008" fromto="0 0 0 0.1 0 0" density="1200"/>'
    '<geom type="ellipsoid" size="0.04 0.01 0.02" pos="0.1 0 0.01" density="900"/>'
    '<geom type="capsule" size="0.006" fromto="0.05 -0.01 0 0.05 0.02 0" mass="0.03"/>'
    '<body name="plate" pos="0.02 0 -0.01"><geom type="sphere" size="0.015" density="3000"/></body>'
    '<body name="c" pos="0.12 0 0"><joint name="jc" axis="0 -1 0" damping="0.001"/>'
    '<inertial pos="0.05 0 0.002" mass="0.05" diaginertia="3e-5 5e-5 5e-5"/>'
    '<geom type="mesh" mesh="wedge"/></body></body></body></worldbody>'
)

ZOO = {
    "single": HEAD + _link("link1", "joint1", "0 0 0") + TAIL,
    "double": HEAD + _link("link1", "joint1", "0 0 0", _link("link2", "joint2", "0.1 -0.008 0")) + TAIL,
    "triple": HEAD
    + _link(
        "link1",
        "joint1",
        "0 0 0",
        _link("link2", "joint2", "0.1 -.008 0", _link("link3", "joint3", "0.1 0 0")),
    )
    + TAIL,
    "bob": HEAD
    + '<body name="link1"><joint name="joint1" axis="0 -1 0" damping="0.001"/>'
    + '<geom type="capsule" size="0.005" fromto="0 0 0 0.2 0 0" density="2700"/>'
    + '<geom type="sphere" size="0.025" pos="0.2 0 0" density="1800"/></body>'
    + TAIL,
    "cartpole": HEAD
    + '<body name="cart"><joint name="slide" type="slide" axis="1 0 0" damping="0.05"/>'
    + '<geom type="box" size="0.06 0.01 0.03" mass="0.3"/>'
    + _link("link1", "joint1", "0 -0.02 0.03")
    + "</body>"
    + TAIL,
    "tree": HEAD
    + _link(
        "link1",
        "joint1",
        "0 0 0",
        _link("left", "joint2", "0.1 -0.01 0", _link("leaf", "joint4", "0.1 -0.01 0"))
        + _link("right", "joint3", "-0.03 -0.01 0.01"),
    )
    + TAIL,
    "cart_branches": HEAD
    + '<body name="cart" pos="0 0 0.1" euler="0 -15 0">'
    + '<joint name="slide" type="slide" axis="1 0 0" damping="0.05"/>'
    + '<geom type="box" size="0.15 0.01 0.03" mass="0.5"/>'
    + _link("link1", "joint1", "0.12 -0.02 0", _link("link2", "joint2", "0.1 -0.008 0"))
    + _link("link3", "joint3", "-0.12 -0.02 0")
    + "</body>"
    + TAIL,
    "planar_body": HEAD
    + '<body name="puck"><joint name="x" type="slide" axis="1 0 0" damping="0.02"/>'
    + '<joint name="z" type="slide" axis="0 0 1" stiffness="5" damping="0.1"/>'
    + '<joint name="turn" type="hinge" axis="0 -1 0" pos="0.01 0 0.02" damping="0.001"/>'
    + '<geom type="box" size="0.05 0.01 0.03" pos="0.02 0 0" density="500"/>'
    + _link("link1", "joint1", "0.05 -0.02 0")
    + "</body>"
    + TAIL,
    "chain": HEAD + _CHAIN + TAIL,
    "shapes": '<mujoco><option gravity="0 0 -9.81" integrator="RK4" timestep="0.002"/>'
    + _SHAPES
    + "</mujoco>",
}
"""MJCF text by name. ``friction`` below belongs to its own test."""

FRICTION = (
    HEAD.replace("RK4", "Euler")
    + (
        '<body name="a"><joint name="ja" axis="0 -1 0" frictionloss="0.02" damping="0.001"/>'
        '<geom type="box" size="0.1 0.003 0.012" pos="0.1 0 0" density="2700"/>'
        '<body name="b" pos="0.2 -0.01 0"><joint name="jb" axis="0 -1 0" frictionloss="0.01" '
        'damping="0.001"/>'
        '<geom type="box" size="0.08 0.003 0.012" pos="0.08 0 0" density="2700"/></body></body>'
    )
    + TAIL
)
