"""Convert between rotation representations, rotate vectors, and invert and compare poses."""

import math

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
FloatArray = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

_GIMBAL_LOCK = 1e-13
"""Cosine of the pitch below which roll and yaw are not unique; roll is then 0."""


def invert_poses(poses: Matrix) -> Matrix:
    """Return the inverses of rigid transforms.

    Args:
        poses: Homogeneous matrices, shape (..., 4, 4).
    """
    result = np.zeros_like(poses)
    transposed = np.swapaxes(poses[..., :3, :3], -1, -2)
    result[..., :3, :3] = transposed
    result[..., :3, 3] = -(transposed @ poses[..., :3, 3, None])[..., 0]
    result[..., 3, 3] = 1.0
    return result


def pose_error(a: Matrix, b: Matrix) -> tuple[Matrix, Matrix]:
    """Return the distances and angles between two arrays of poses.

    The angle is computed from the Frobenius norm |A - B| = sqrt(8) sin(angle / 2). Unlike the arc
    cosine of the trace, this is accurate for small angles.

    Args:
        a: Poses, shape (..., 4, 4).
        b: Poses, shape (..., 4, 4).

    Returns:
        Distances [m] and angles [rad], each of shape (...).
    """
    distance = np.linalg.norm(a[..., :3, 3] - b[..., :3, 3], axis=-1)
    difference = np.linalg.norm(a[..., :3, :3] - b[..., :3, :3], axis=(-2, -1))
    return distance, 2 * np.arcsin(np.clip(difference / math.sqrt(8), 0.0, 1.0))


def quat_to_matrix(quat: Matrix) -> Matrix:
    """Return the rotation matrix of a quaternion.

    Args:
        quat: Quaternion (w, x, y, z), shape (4,). It does not have to be normalized.

    Returns:
        Rotation matrix, shape (3, 3).
    """
    w, x, y, z = map(float, quat)
    if x == y == z == 0:
        return np.eye(3)
    length = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / length, x / length, y / length, z / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def matrix_to_quat(rotation: Matrix) -> Matrix:
    """Return the quaternion of a rotation.

    The largest element is computed first, as in MuJoCo, so that no division loses accuracy.

    Args:
        rotation: Rotation matrix, shape (3, 3).

    Returns:
        Unit quaternion (w, x, y, z) with w >= 0, shape (4,).
    """
    trace = rotation.trace()
    # Products of the quaternion with its largest element, times 4.
    products = np.empty((4, 4))
    products[0] = [
        1 + trace,
        rotation[2, 1] - rotation[1, 2],
        rotation[0, 2] - rotation[2, 0],
        rotation[1, 0] - rotation[0, 1],
    ]
    products[1:, 0] = products[0, 1:]
    products[1:, 1:] = rotation + rotation.T + (1 - trace) * np.eye(3)
    quat = products[int(products.diagonal().argmax())]
    return np.asarray(quat / np.copysign(np.linalg.norm(quat), quat[0]))


def rpy_to_matrix(rpy: Matrix) -> Matrix:
    """Return the rotation matrix of roll, pitch and yaw, as in URDF.

    Args:
        rpy: Roll, pitch and yaw [rad] about the fixed axes x, y and z, shape (3,).

    Returns:
        Rotation matrix Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3).
    """
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def matrix_to_rpy(rotation: Matrix) -> Matrix:
    """Return the roll, pitch and yaw of a rotation, as in URDF.

    The rotation is Rz(yaw) Ry(pitch) Rx(roll). Yaw is computed last, from Rz(yaw) Ry(pitch), so it
    compensates for an inaccurate roll near gimbal lock.

    Args:
        rotation: Rotation matrix, shape (3, 3).

    Returns:
        Roll, pitch and yaw [rad], shape (3,).
    """
    cos_pitch = math.hypot(rotation[2, 1], rotation[2, 2])
    roll = math.atan2(rotation[2, 1], rotation[2, 2]) if cos_pitch > _GIMBAL_LOCK else 0.0
    pitch = math.atan2(-rotation[2, 0], cos_pitch)
    s, c = math.sin(roll), math.cos(roll)
    yaw = math.atan2(
        s * rotation[0, 2] - c * rotation[0, 1], c * rotation[1, 1] - s * rotation[1, 2]
    )
    return np.array([roll, pitch, yaw])


def axis_angle_to_matrix(axis: Matrix, angle: Matrix | np.float64) -> Matrix:
    """Return rotation matrices about one axis by Rodrigues' formula.

    Args:
        axis: Unit vector, shape (3,).
        angle: Angles [rad], shape (...).

    Returns:
        Rotation matrices, shape (..., 3, 3).
    """
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.asarray(np.eye(3) + s * cross + (1 - c) * (cross @ cross))


def quat_rotate_inverse(quat: FloatArray, vector: FloatArray) -> FloatArray:
    """Rotate vectors from the world frame to body frames.

    With q = (w, u): v' = v - 2 w (u x v) + 2 u x (u x v), the rotation by the conjugate of q.

    Args:
        quat: Unit quaternions (w, x, y, z) of the bodies, shape (n, 4).
        vector: Vectors in the world frame, shape (n, 3).

    Returns:
        Vectors in the body frames, shape (n, 3).
    """
    # Numbers of one component at a time take a third of the time of np.cross.
    w, x, y, z = quat.T
    a, b, c = vector.T
    p, q, r = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    components = [
        a - w * p + (y * r - z * q),
        b - w * q + (z * p - x * r),
        c - w * r + (x * q - y * p),
    ]
    return np.stack(components, axis=1)


def wrap_to_pi(angle: FloatArray) -> FloatArray:
    """Wrap angles to the range from -pi to pi.

    Args:
        angle: Angles [rad], any shape.
    """
    return (angle + np.float32(np.pi)) % np.float32(2 * np.pi) - np.float32(np.pi)
