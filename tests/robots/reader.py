"""An independent reader of URDF and SRDF: the standard library's tree, rotations by SciPy, one joint after another."""

import xml.etree.ElementTree as ElementTree

import numpy as np
from scipy.spatial.transform import Rotation


class Reader:
    """A robot's joints and bodies as the file has them, and where its links are."""

    def __init__(self, path):
        self.root = ElementTree.parse(path).getroot()
        self.links = [link.get("name") for link in self.root.findall("link")]
        self.joints = {joint.get("name"): joint for joint in self.root.findall("joint")}
        self.parent = {j.find("child").get("link"): name for name, j in self.joints.items()}

    def position(self, name, given):
        """Return where a joint is when those that lead are as given."""
        mimic = self.joints[name].find("mimic")
        if mimic is None:
            return given.get(name, 0.0)
        leads = self.position(mimic.get("joint"), given)
        return float(mimic.get("multiplier", 1)) * leads + float(mimic.get("offset", 0))

    def pose(self, link, given):
        """Return T_root_link (4, 4)."""
        T = np.eye(4)
        while link in self.parent:
            joint = self.joints[self.parent[link]]
            T = origin(joint) @ self.motion(joint, given) @ T
            link = joint.find("parent").get("link")
        return T

    def motion(self, joint, given):
        T = np.eye(4)
        if joint.get("type") not in ("revolute", "continuous", "prismatic"):
            return T
        axis = joint.find("axis")
        axis = np.array([1.0, 0.0, 0.0]) if axis is None else np.array(axis.get("xyz").split(), float)
        axis = axis / np.linalg.norm(axis)
        q = self.position(joint.get("name"), given)
        if joint.get("type") == "prismatic":
            T[:3, 3] = q * axis
        else:
            T[:3, :3] = Rotation.from_rotvec(q * axis).as_matrix()
        return T


def origin(element):
    T = np.eye(4)
    written = element.find("origin")
    if written is not None:
        T[:3, 3] = np.array(written.get("xyz", "0 0 0").split(), float)
        T[:3, :3] = Rotation.from_euler("xyz", np.array(written.get("rpy", "0 0 0").split(), float)).as_matrix()
    return T


def disabled(path):
    """Return the set of pairs that an SRDF disables."""
    root = ElementTree.parse(path).getroot()
    return {frozenset((e.get("link1"), e.get("link2"))) for e in root.findall("disable_collisions")}
