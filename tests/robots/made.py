"""Robots that tests make: trees of links with every kind of joint, mimic chains and bodies, from a seed."""

import numpy as np

BODIES = (
    '<box size="0.1 0.2 0.3"/>',
    '<cylinder radius="0.05" length="0.2"/>',
    '<sphere radius="0.06"/>',
    '<capsule radius="0.05" length="0.1"/>',
)


def urdf(seed, links=12, mimics=4):
    """Return the text of a random robot; joints that follow do so in chains."""
    random = np.random.default_rng(seed)

    def numbers(count, low, high):
        return " ".join(repr(float(value)) for value in random.uniform(low, high, count))

    lines = [f'<robot name="made_{seed}">']
    movable = []
    for k in range(links):
        body = BODIES[k % len(BODIES)]
        pose = f'<origin xyz="{numbers(3, -0.1, 0.1)}" rpy="{numbers(3, -3, 3)}"/>'
        lines.append(f'<link name="l{k}"><collision>{pose}<geometry>{body}</geometry></collision></link>')
        if k == 0:
            continue
        kind = random.choice(["fixed", "revolute", "continuous", "prismatic"])
        limit = '<limit lower="-1.5" upper="2" velocity="1" effort="1"/>' if kind in ("revolute", "prismatic") else ""
        mimic = ""
        if movable and kind != "fixed" and mimics > 0 and random.random() < 0.5:
            numbers_of = f'multiplier="{numbers(1, -0.9, 0.9)}" offset="{numbers(1, -0.2, 0.2)}"'
            mimic, mimics = f'<mimic joint="{random.choice(movable)}" {numbers_of}/>', mimics - 1
        if kind != "fixed":
            movable.append(f"j{k}")
        lines.append(
            f'<joint name="j{k}" type="{kind}"><origin xyz="{numbers(3, -0.5, 0.5)}" rpy="{numbers(3, -3, 3)}"/>'
            f'<parent link="l{random.integers(k)}"/><child link="l{k}"/><axis xyz="{numbers(3, -1, 1)}"/>'
            f"{limit}{mimic}</joint>"
        )
    return "\n".join([*lines, "</robot>"])


def link(name, *bodies):
    """Return a link with collision bodies."""
    held = "".join(f"<collision><geometry>{body}</geometry></collision>" for body in bodies)
    return f'<link name="{name}">{held}</link>'


def joint(name, parent, child, kind="fixed", inside=""):
    """Return a joint."""
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def robot(*parts):
    """Return a robot of links and joints."""
    return "<robot name='r'>\n" + "\n".join(parts) + "\n</robot>\n"
