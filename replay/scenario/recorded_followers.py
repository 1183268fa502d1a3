"""What a log says of joints that follow others: it does not move them, and is compared with what they follow."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from replay.kinematics.linkage import Joint, Mimic
from replay.kinematics.motion import Track
from replay.logs.csv_table import unit_of
from replay.logs.joint_log import JointLog
from replay.numerics.arrays import Floats
from replay.scenario.recorded_series import Unusable


def of_the_same_name(joint: str, log: JointLog) -> str:
    """Return what a log calls the joint of a name, also with its quantity and unit as exports write it; or ""."""
    exported = {unit_of(name)[0]: name for name in log.joints}
    return joint if joint in log.joints else exported.get(f"{joint} position", exported.get(joint, ""))


def deviations(
    joints: Mapping[str, Joint],
    followers: Mapping[str, Mimic],
    tracks: Mapping[str, Track],
    log: JointLog,
    read: Callable[[str, str], tuple[Floats, Floats]],
) -> Iterator[str]:
    """Yield how far the log's positions of each joint that follows a recorded one are from what it follows.

    Args:
        joints: by name.
        followers: what each of them follows.
        tracks: recorded motion by joint.
        log: where they may be.
        read: returns times (n,) [s] and positions (n,) [rad or m], given the type of a joint and its name in the log.
    """
    for name, mimic in followers.items():
        theirs, leader = of_the_same_name(name, log), tracks.get(mimic.joint)
        if not theirs or leader is None:
            continue
        says, joint = f"holds joint {theirs!r}, which follows {mimic.joint!r}", joints[name]
        try:
            seconds, measured = read(joint.type.value, theirs)
        except Unusable as error:
            yield f"{says}, and cannot be compared with it: it {error.rule}"
            continue
        off = np.abs(measured - mimic.offset - mimic.multiplier * np.interp(seconds, leader.seconds, leader.positions))
        if joint.type.value == "continuous":
            off = np.abs(off - 2.0 * math.pi * np.rint(off / (2.0 * math.pi)))
        at = int(off.argmax())
        yield f"{says}: the largest deviation is {off[at]:.3g} {joint.type.unit} at {seconds[at]:.6g} s"
