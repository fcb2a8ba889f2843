"""The metadata of ONNX files that mjlab's exporter writes: comma-separated lists by key."""

from collections.abc import Iterable, Mapping

from terrainkit.errors import ConfigError
from terrainkit.settings.text import truncate
from terrainkit_robots.policy.contracts.contract import MJLAB, Contract, ContractTerm

RUN_PATH, JOINTS_KEY = "terrainkit", "joint_names"
"""Run of terrainkit's policies, and the key that tells whether a file has this metadata."""

MAX_LENGTH = 1 << 16
"""Largest value that is read [characters]."""

_INFINITE = float("-inf"), float("inf")


def read_metadata(metadata: Mapping[str, str]) -> Contract:
    """Return the contract in the metadata of an ONNX file.

    Files of mjlab before 1.5 lack the keys of the observation terms: scale 1, no clip, no history.

    Args:
        metadata: Text by key.

    Raises:
        ConfigError: If a key is missing, or a value is not of the expected kind.
    """
    joints = _split(metadata, JOINTS_KEY)
    names = _split(metadata, "observation_names")

    def per_joint(key: str) -> tuple[float, ...]:
        values = tuple(_number(key, number) for number in _split(metadata, key))
        return values * len(joints) if len(values) == 1 else values

    def per_term(key: str, default: str) -> list[str]:
        key = f"observation_terms_{key}"
        values = _split(metadata, key) if key in metadata else [default] * len(names)
        if len(values) != len(names):
            got = f"got {len(values)} values for {len(names)} observation terms"
            raise ConfigError(f"{key}: {got}; expected one for each, separated by commas")
        return values

    flat = per_term("flatten_history_dim", "1")
    history = per_term("history_length", "0")
    terms = []
    rows = zip(names, per_term("scale", "1"), per_term("clip", ""), history, flat, strict=True)
    for name, scale, clip, steps, is_flat in rows:
        length = _number(f"history_length of {name}", steps)
        if length > 0 and is_flat.strip().lower() in ("false", "0", "0.000"):
            raise ConfigError(f"flatten_history_dim of {name}: got {is_flat}; expected True")
        limits = tuple(_number(f"clip of {name}", number) for number in clip.split(";") if number)
        term = ContractTerm(
            name=name,
            scale=tuple(_number(f"scale of {name}", number) for number in scale.split(";")),
            clip=(limits[0], limits[1]) if len(limits) == 2 and limits != _INFINITE else None,
            history=max(1, int(length)) if 0 <= length <= 1e6 else 0,
            # mjlab's tasks read the velocity from a sensor of the IMU, terrainkit's from the base.
            params={"imu": float(metadata.get("run_path") != RUN_PATH)},
        )
        terms.append(term)
    pose = per_joint("default_joint_pos")
    return Contract(
        style=MJLAB,
        joints=tuple(joints),
        default_pose=pose,
        stiffness=per_joint("joint_stiffness"),
        damping=per_joint("joint_damping"),
        action_scale=per_joint("action_scale"),
        action_offset=pose,
        terms=tuple(terms),
    )


def write_metadata(contract: Contract) -> dict[str, str]:
    """Return the metadata of an ONNX file with a contract of this style, by key."""
    terms = contract.terms
    return {
        "run_path": RUN_PATH,
        JOINTS_KEY: ",".join(contract.joints),
        "joint_stiffness": _join(contract.stiffness),
        "joint_damping": _join(contract.damping),
        "default_joint_pos": _join(contract.default_pose),
        "command_names": "twist",
        "observation_names": ",".join(term.name for term in terms),
        "observation_terms_scale": ",".join(_join(term.scale, ";") for term in terms),
        "observation_terms_clip": ",".join(_join(term.clip or _INFINITE, ";") for term in terms),
        # 0 is the current step alone.
        "observation_terms_history_length": ",".join(
            str(term.history if term.history > 1 else 0) for term in terms
        ),
        "observation_terms_flatten_history_dim": ",".join("1" for _ in terms),
        "action_scale": _join(contract.action_scale),
    }


def _join(values: Iterable[float], separator: str = ",") -> str:
    return separator.join(f"{value:.9g}" for value in values)


def _split(metadata: Mapping[str, str], key: str) -> list[str]:
    text = metadata.get(key, "")
    if not text or len(text) > MAX_LENGTH:
        got = f"got {len(text)} characters" if text else "missing in the metadata"
        raise ConfigError(f"{key}: {got}; expected a list separated by commas, as mjlab writes it")
    return [word.strip() for word in text.split(",")]


def _number(key: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ConfigError(f"{key}: got {truncate(repr(text))}; expected a number") from None
