"""The device: where the networks are. The physics is on the CPU, whatever it is."""

import torch

from terrainkit.errors import ConfigError, listing


def require_device(name: str) -> str:
    """Return a device that is there, by torch's name: `cpu`, `cuda`, `cuda:1`.

    Raises:
        ConfigError: if it is not; it says which are.
    """
    count = torch.cuda.device_count()
    try:
        device = torch.device(name)
    except RuntimeError:
        device = None
    if device is not None and device.type == "cpu":
        return "cpu"
    if device is not None and device.type == "cuda" and (device.index or 0) < count:
        return name
    there = ["cpu", *(f"cuda:{k}" for k in range(count))]
    raise ConfigError(f"device {name!r}; here there is: {listing(there)}")
