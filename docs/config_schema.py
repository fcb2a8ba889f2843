"""JSON schemas of the TOML files, which editors use to complete keys and mark errors."""

import dataclasses
import inspect
import json
from collections.abc import Iterator
from typing import Any

import msgspec

from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.schema import Config, field_keys, field_types
from terrainkit.settings.type_hint import NONE, parse_hint
from terrainkit_robots.spec.robot_spec import FORMAT_VERSION, RobotSpec


def config_schema(config: type[Config]) -> str:
    """Return the JSON schema of the TOML file of a config."""
    schema = msgspec.json.schema(config)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    for kind in {*tables_of(config)}:
        definition = schema["$defs"][kind.__name__]
        docs, old = field_docs(kind), definition["properties"]
        names = {key: name for key, name in field_keys(kind).items() if name in old}
        # The parameters of a terrain are keys of its table.
        parameters = names.pop("parameters", None)
        definition["properties"] = {
            key: {**written(old[name]), "description": docs.get(name, "")}
            for key, name in names.items()
        }
        definition["additionalProperties"] = parameters is not None
        definition["description"] = (inspect.getdoc(kind) or "").splitlines()[0]
        if "required" in definition:
            keys = {name: key for key, name in names.items()}
            definition["required"] = [keys[name] for name in definition["required"]]
    if config is RobotSpec:
        schema["$defs"]["RobotSpec"]["properties"]["format_version"] = {"const": FORMAT_VERSION}
    return f"{json.dumps(schema, indent=1)}\n"


def tables_of(config: type[Config]) -> Iterator[type[Any]]:
    """Yield a config and the dataclasses of its tables."""
    yield config
    for hint in field_types(config).values():
        parsed = parse_hint(hint)
        for kind in (parsed.kind, *(parse_hint(argument).kind for argument in parsed.args)):
            if dataclasses.is_dataclass(kind) and kind is not config:
                yield from tables_of(kind)


def written(schema: Any) -> Any:
    """Return the schema of a value as TOML has it: the string "none" in place of null."""
    if isinstance(schema, list):
        return [written(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if schema == {"type": "null"}:
        return {"const": NONE}
    return {
        key: NONE if key == "default" and value is None else written(value)
        for key, value in schema.items()
        if (key, value) != ("default", {})  # msgspec 0.23 states it, and 0.22 does not
    }
