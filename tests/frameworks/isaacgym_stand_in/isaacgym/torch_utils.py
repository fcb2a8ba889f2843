import numpy as np
import torch


def to_torch(values, device="cpu", requires_grad=False):
    return torch.tensor(values, dtype=torch.float, device=device, requires_grad=requires_grad)


def get_axis_params(value, axis):
    params = np.zeros(3)
    params[axis] = value
    return list(params)


def torch_rand_float(lower, upper, shape, device):
    return lower + (upper - lower) * torch.rand(*shape, device=device)


def normalize(vectors):
    return vectors / vectors.norm(dim=-1, keepdim=True).clamp(min=1e-9)


def quat_apply(quat, vectors):
    """Rotate vectors by quaternions (x, y, z, w)."""
    shape = vectors.shape
    quat, vectors = quat.reshape(-1, 4), vectors.reshape(-1, 3)
    axis = quat[:, :3]
    twice = 2 * torch.cross(axis, vectors, dim=-1)
    return (vectors + quat[:, 3:] * twice + torch.cross(axis, twice, dim=-1)).view(shape)


def quat_rotate_inverse(quat, vectors):
    return quat_apply(quat * quat.new_tensor([-1.0, -1.0, -1.0, 1.0]), vectors)
