"""Reference simulation of spring joints, following the pseudocode of ``VRMC_springBone`` 1.0."""

import math

import numpy as np

from viewer.rigs.skeleton import Skeleton

STEP = 1.0 / 60.0


def rotation_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the matrix of the smallest rotation between unit vectors (Rodrigues)."""
    axis, cosine = np.cross(start, end), float(start @ end)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + cosine)


def turn(quaternion: np.ndarray) -> np.ndarray:
    """Return the matrix of a quaternion (x, y, z, w), from the axis and the angle."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return np.eye(3)
    x, y, z, angle = x / length, y / length, z / length, 2.0 * math.atan2(length, w)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


class Reference:
    """The state of all spring joints; each step is given their local matrices."""

    def __init__(self, skeleton: Skeleton, locals_: np.ndarray) -> None:
        self.skeleton, self.springs = skeleton, skeleton.springs
        self.row = {int(joint): row for row, joint in enumerate(self.springs.joints)}
        world = self.worlds(locals_)
        self.now, self.before = {}, {}
        for joint, row in self.row.items():
            tail = self.point(world[joint], self.springs.tails[row])
            self.now[joint] = self.before[joint] = self.to_center(world, row, tail)

    def point(self, matrix: np.ndarray, point: np.ndarray) -> np.ndarray:
        return (matrix @ np.append(point, 1.0))[:3]

    def to_center(self, world: np.ndarray, row: int, point: np.ndarray) -> np.ndarray:
        center = int(self.springs.centers[row])
        return point if center < 0 else self.point(np.linalg.inv(world[center]), point)

    def from_center(self, world: np.ndarray, row: int, point: np.ndarray) -> np.ndarray:
        center = int(self.springs.centers[row])
        return point if center < 0 else self.point(world[center], point)

    def worlds(self, locals_: np.ndarray) -> np.ndarray:
        """Return world matrices with spring joints in their rest rotation."""
        world = np.zeros_like(locals_)
        for joint, parent in enumerate(self.skeleton.parents.tolist()):
            above = np.eye(4) if parent < 0 else world[parent]
            world[joint] = above @ self.local(locals_, joint)
        return world

    def local(self, locals_: np.ndarray, joint: int) -> np.ndarray:
        if joint not in self.row:
            return locals_[joint]
        found = locals_[joint].copy()
        found[:3, :3] = turn(self.skeleton.rest_rotations[joint])
        return found

    def step(self, locals_: np.ndarray, animated: np.ndarray) -> dict[int, np.ndarray]:
        """Return the local rotation matrix of each spring joint after one step.

        ``animated``: world matrices of the pose without springs.
        """
        springs, world, rotations = self.springs, animated.copy(), {}
        moved: set[int] = set()
        for joint, parent in enumerate(self.skeleton.parents.tolist()):
            if joint not in self.row and parent not in moved:
                continue
            moved.add(joint)
            above = np.eye(4) if parent < 0 else world[parent]
            rest = above @ self.local(locals_, joint)
            world[joint] = rest
            if joint not in self.row:
                continue
            row = self.row[joint]
            head, tail = rest[:3, 3], springs.tails[row]
            axis = tail / np.linalg.norm(tail)
            length = np.linalg.norm(rest[:3, :3] @ tail)
            inertia = (self.now[joint] - self.before[joint]) * (1.0 - springs.drags[row])
            # The centre may be an ancestor that has moved in this step.
            following = self.from_center(world, row, self.now[joint] + inertia)
            following = following + STEP * springs.stiffness[row] * (rest[:3, :3] @ axis)
            following = following + STEP * springs.gravities[row]
            following = head + (following - head) / np.linalg.norm(following - head) * length
            for index in springs.obstacles[row]:
                following = self.pushed(world, row, index, following, head, length)
            self.before[joint] = self.now[joint]
            self.now[joint] = self.to_center(world, row, following)
            to = self.point(np.linalg.inv(rest), following)
            arc = rotation_between(axis, to / np.linalg.norm(to))
            rotations[joint] = turn(self.skeleton.rest_rotations[joint]) @ arc
            bent = np.eye(4)
            bent[:3, :3] = arc
            world[joint] = rest @ bent
        return rotations

    def pushed(self, world, row, index, point, head, length):
        shapes = self.springs.colliders
        matrix = world[shapes.joints[index]]
        start = self.point(matrix, shapes.offsets[index])
        end = self.point(matrix, shapes.tails[index])
        along, delta = end - start, point - start
        dot = along @ delta
        if dot > along @ along:
            delta = delta - along
        elif dot > 0.0:
            delta = delta - along * (dot / (along @ along))
        distance = np.linalg.norm(delta) - shapes.radii[index] - self.springs.radii[row]
        if distance >= 0.0:
            return point
        point = point - delta / np.linalg.norm(delta) * distance
        return head + (point - head) / np.linalg.norm(point - head) * length
