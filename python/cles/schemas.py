# SPDX-License-Identifier: BSL-1.0
"""The schemas by which nodes tell types (docs/protocol.md, "Types"): from Python types, and as Python dataclasses."""

from __future__ import annotations

import dataclasses
import enum
import keyword
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any, Literal, get_args, get_origin

from . import jsontext
from .errors import ConversionError
from .types import Field, alternatives_of, is_scalar, members_of, split_field, to_json

_MICROSECONDS = {"num": 1, "den": 1_000_000, "minimum": -(2**63), "maximum": 2**63 - 1}


# --- From Python types -------------------------------------------------------------------------------------------------


class _Writer:
    def __init__(self) -> None:
        self.definitions: dict[str, Any] = {}
        self._names: dict[type, str] = {}

    def write(self, hint: Any) -> dict[str, Any]:
        hint, field = split_field(hint)
        return _with_note(self._plain(hint), field)

    def _plain(self, hint: Any) -> dict[str, Any]:
        origin, arguments = get_origin(hint), get_args(hint)
        if alternatives_of(hint):
            return {"anyOf": [self.write(each) for each in arguments]}
        if origin is Literal:
            return {"enum": list(arguments)}
        if origin in (list, set, frozenset, Sequence) or (origin is tuple and arguments[1:] == (...,)):
            return {"type": "array", "items": self.write(arguments[0])}
        if origin is tuple:
            return {"type": "array", "prefixItems": [self.write(each) for each in arguments],
                    "minItems": len(arguments), "maxItems": len(arguments)}
        if origin in (dict, Mapping):
            keys = {"propertyNames": {"format": "integer"}} if arguments[0] is int else {}
            return {"type": "object", **keys, "additionalProperties": self.write(arguments[1])}
        if hint is None or hint is type(None):
            return {"type": "null"}
        if isinstance(hint, type):
            return self._type(hint)
        return {}

    def _type(self, hint: type) -> dict[str, Any]:
        if dataclasses.is_dataclass(hint):
            return {"$ref": f"#/$defs/{self._define(hint)}"}
        if issubclass(hint, enum.Flag):
            return {"anyOf": [{"enum": list(hint.__members__)},
                              {"type": "integer", "minimum": 0, "flags": [each.value for each in hint]}]}
        if issubclass(hint, enum.Enum):
            return {"enum": list(hint.__members__)}
        if hint is datetime:
            return {"type": ["string", "number"], "format": "date-time", "ticks": _MICROSECONDS}
        if hint is timedelta:
            return {"type": ["string", "number"], "format": "duration", "ticks": _MICROSECONDS}
        names = {bool: "boolean", int: "integer", str: "string", list: "array", dict: "object"}
        if hint is float:
            return {"type": ["number", "null"]}  # null is a number that is not finite
        return {"type": names[hint]} if hint in names else {}

    def _define(self, cls: type) -> str:
        if cls in self._names:
            return self._names[cls]
        name, number = cls.__name__, 2
        while name in self.definitions:
            name, number = f"{cls.__name__}_{number}", number + 1
        self._names[cls] = name
        schema = self.definitions[name] = {"type": "object", "properties": {}}
        required = []
        for member in members_of(cls):
            told = _with_note(self.write(member.type), member.field)
            if member.default is None:
                required.append(member.name)
            elif (default := member.default()) is not None:
                try:
                    told = {**told, "default": jsontext.read(jsontext.write(default, to_json))}
                except (ConversionError, jsontext.Invalid):
                    pass
            schema["properties"][member.name] = told
        if required:
            schema["required"] = required
        return name


def _with_note(schema: dict[str, Any], field: Field) -> dict[str, Any]:
    told = dict(schema)
    for key in ("description", "unit"):
        if value := getattr(field, key):
            told[key] = value
    for key in ("minimum", "maximum"):
        if (limit := getattr(field, key)) is not None:
            told[key] = limit
    return told


def check_told(types: dict[str, Any]) -> dict[str, Any]:
    """What a verb of a task tells; refused if it is longer than others read."""
    text = jsontext.write(types)
    jsontext.read(text, 30)
    if len(text.encode()) > 65_536:
        raise ValueError("the types of a task have more than 65536 bytes")
    return types


def content_schema(hint: Any) -> dict[str, Any]:
    """Of what is sent as a body, a result or an update. Empty: nothing is known."""
    if hint is None or hint is type(None):
        return {"type": "object", "maxProperties": 0}
    writer = _Writer()
    schema = writer.write(hint)
    if schema and is_scalar(hint):
        required = {} if type(None) in alternatives_of(hint) else {"required": ["value"]}
        schema = {"type": "object", "properties": {"value": schema}, **required}
    return {**schema, "$defs": writer.definitions} if writer.definitions else schema


# --- As Python dataclasses ---------------------------------------------------------------------------------------------


def _words(name: str) -> list[str]:
    return [word for word in re.split(r"[^A-Za-z0-9]+", name) if word]


def _class_name(name: str) -> str:
    made = "".join(word[0].upper() + word[1:] for word in _words(name)) or "Type"
    return f"T{made}" if made[0].isdigit() else made


def _attribute(name: str) -> str:
    made = "_".join(_words(name)) or "member"
    made = f"_{made}" if made[0].isdigit() else made
    return f"{made}_" if keyword.iskeyword(made) else made


class _Source:
    """Writes dataclasses. The schemas are a peer's: only names and literals of it get into the text."""

    def __init__(self) -> None:
        self.classes: dict[str, str] = {}
        self.imports: set[str] = set()
        self._roots: dict[tuple[str, str], str] = {}
        self._steps = 0
        self._root: dict[str, Any] = {}

    def name_of(self, schema: Any, root: dict[str, Any], name: str) -> str:
        """The type that stands for a schema; the classes that it needs are added."""
        self._root = root
        return self._type(schema, name, 0)

    def _type(self, schema: Any, name: str, depth: int) -> str:
        self._steps += 1
        if not isinstance(schema, dict) or depth > 16 or self._steps > 20_000:  # a peer's schema may branch without end
            return self._any()
        reference = schema.get("$ref")
        if isinstance(reference, str):
            return self._reference(reference, depth)
        values = schema.get("enum", [schema["const"]] if "const" in schema else None)
        if isinstance(values, list) and values:
            return self._literal(values)
        any_of = schema.get("anyOf")
        if isinstance(any_of, list) and any_of:
            if any(isinstance(each, dict) and "flags" in each for each in any_of):
                any_of = [each for each in any_of if isinstance(each, dict)]
            return " | ".join(dict.fromkeys(self._type(each, name, depth + 1) for each in any_of))
        return self._typed(schema, name, depth)

    def _typed(self, schema: dict[str, Any], name: str, depth: int) -> str:
        types = schema.get("type")
        types = [types] if isinstance(types, str) else types if isinstance(types, list) else []
        match schema.get("format"):
            case "date-time":
                return self._from_datetime("datetime")
            case "duration":
                return self._from_datetime("timedelta")
        if "number" in types:
            return "float"  # also of null
        names = [self._one_type(each, schema, name, depth) for each in types if isinstance(each, str)]
        return " | ".join(dict.fromkeys(names)) or self._any()

    def _one_type(self, type: str, schema: dict[str, Any], name: str, depth: int) -> str:
        if type == "array":
            first = schema.get("prefixItems")
            if isinstance(first, list) and first:
                return f"tuple[{', '.join(self._type(each, name, depth + 1) for each in first)}]"
            return f"list[{self._type(schema.get('items'), name, depth + 1)}]"
        if type == "object":
            if isinstance(schema.get("properties"), dict) and schema["properties"]:
                return self._class(_class_name(name), schema, depth)
            keys = schema.get("propertyNames")
            key = "int" if isinstance(keys, dict) and keys.get("format") == "integer" else "str"
            return f"dict[{key}, {self._type(schema.get('additionalProperties'), name, depth + 1)}]"
        return {"string": "str", "integer": "int", "boolean": "bool", "null": "None"}.get(type) or self._any()

    def _any(self) -> str:
        self.imports.add("from typing import Any")
        return "Any"

    def _from_datetime(self, name: str) -> str:
        self.imports.add(f"from datetime import {name}")
        return name

    def _literal(self, values: list[Any]) -> str:
        if all(each is None for each in values):
            return "None"
        self.imports.add("from typing import Literal")
        return f"Literal[{', '.join(repr(each) for each in values if isinstance(each, (str, int, bool)) or each is None)}]"

    def _reference(self, reference: str, depth: int) -> str:
        definitions = self._root.get("$defs")
        name = reference.removeprefix("#/$defs/")
        target = definitions.get(name) if isinstance(definitions, dict) else None
        if reference == "#":
            return self._any()
        if isinstance(target, dict) and isinstance(target.get("properties"), dict):
            return self._class(_class_name(name), target, depth)
        return self._type(target, name, depth + 1)

    def _class(self, name: str, schema: dict[str, Any], depth: int) -> str:
        # One class for equal schemas of one name: tasks of a node have types in common.
        key = name, jsontext.write(schema)
        if key in self._roots:
            return self._roots[key]
        unique, number = name, 2
        while unique in self.classes:
            unique, number = f"{name}{number}", number + 1
        self._roots[key] = unique
        self.classes[unique] = ""  # its place
        stated = schema.get("required")
        required = stated if isinstance(stated, list) else []
        members = sorted(schema["properties"].items(), key=lambda each: each[0] not in required)
        lines = [self._member(member, told, member in required, depth) for member, told in members]
        self.classes[unique] = f"@dataclass\nclass {unique}:\n" + "\n".join(f"    {line}" for line in lines)
        return unique

    def _member(self, name: str, schema: Any, required: bool, depth: int) -> str:
        told = schema if isinstance(schema, dict) else {}
        type = self._type(schema, name, depth + 1)
        attribute = _attribute(name)
        notes = [("name", name)] if attribute != name else []
        notes += [(key, told[key]) for key in ("unit", "description") if isinstance(told.get(key), str)]
        limits = [(key, told[key]) for key in ("minimum", "maximum")
                  if isinstance(told.get(key), (int, float)) and abs(told[key]) <= 2**53]
        notes += limits if len(limits) == 2 else []
        default = ""
        if not required:
            value = told.get("default")
            is_kept = isinstance(value, (str, int, float, bool)) and type in ("str", "int", "float", "bool")
            type, default = (type, f" = {value!r}") if is_kept else (type if "None" in type.split(" | ") else f"{type} | None",
                                                                    " = None")
        if notes:
            self.imports |= {"from typing import Annotated", "from cles import Field"}
            type = f"Annotated[{type}, Field({', '.join(f'{key}={value!r}' for key, value in notes)})]"
        return f"{attribute}: {type}{default}"


def dataclasses_of(told: Iterable[tuple[str, Mapping[str, Any]]]) -> str:
    """Python source for what tasks tell: pairs of a task and the reply to `PULL self:cles/types/<task>`."""
    source = _Source()
    comments = []
    for task, verbs in told:
        for verb, parts in verbs.items():
            if not isinstance(parts, dict):
                continue
            line = [f"# {_printable(verb)} {_printable(task)}"]
            for part in ("body", "result", "updates"):
                schema = parts.get(part)
                if isinstance(schema, dict) and schema.get("maxProperties") != 0:
                    wrapped = _scalar_in(schema)
                    name = source.name_of(schema if wrapped is None else wrapped, schema, f"{task} {part}")
                    line.append(f"{part}: {name}")
            comments.append("  ".join(line))
    imports = {"from dataclasses import dataclass", *source.imports} if source.classes else source.imports
    parts = ["from __future__ import annotations", *([""] if imports else []), *_merged(imports)] if source.classes else \
        _merged(imports)
    return "\n".join([*parts, *(["", *comments] if parts else comments), *(f"\n\n{text}" for text in source.classes.values())]) \
        + "\n"


def _merged(imports: set[str]) -> list[str]:
    """One line for each module, and our own last."""
    by_module: dict[str, list[str]] = {}
    for line in sorted(imports):
        _, module, _, name = line.split(" ")
        by_module.setdefault(module, []).append(name)
    standard = [f"from {module} import {', '.join(names)}" for module, names in sorted(by_module.items()) if module != "cles"]
    return [*standard, *(["", f"from cles import {', '.join(by_module['cles'])}"] if "cles" in by_module else [])]


def _scalar_in(schema: dict[str, Any]) -> Any:
    """Of {"value":x}, the schema of x; None: it is no scalar."""
    properties = schema.get("properties")
    if schema.get("type") == "object" and isinstance(properties, dict) and set(properties) == {"value"} and "$ref" not in schema:
        return properties["value"]
    return None


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)
