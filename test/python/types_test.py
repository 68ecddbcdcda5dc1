#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Types: to and from JSON, the schemas that nodes tell, and dataclasses from schemas."""

from __future__ import annotations

import enum
import json
import math
import unittest
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from typing import Annotated, Any, Literal

from cles import ConversionError, Field, jsontext
from cles.schemas import content_schema, dataclasses_of
from cles.types import from_json, to_json


class Gear(enum.Enum):
    park = 1
    drive = 2


class Lamps(enum.Flag):
    low = 1
    high = 2


class Level(enum.IntEnum):
    one = 1


@dataclass
class Position:
    lat: Annotated[float, Field(unit="deg", description="latitude, WGS 84", minimum=-90, maximum=90)]
    lon: float
    klass: Annotated[str, Field(name="class")] = "car"
    gear: Gear = Gear.park
    lamps: Lamps = Lamps.low
    level: Level = Level.one
    at: datetime | None = None
    took: timedelta = timedelta(seconds=1.5)
    path: list[tuple[float, float]] = field(default_factory=list)
    by: dict[int, str] = field(default_factory=dict)
    kind: Literal["a", "b"] = "a"


@dataclass
class Tree:
    name: str
    children: list[Tree] = field(default_factory=list)


def written(value: Any) -> str:
    return jsontext.write(value, to_json)


class Conversion(unittest.TestCase):
    def test_there_and_back(self):
        value = Position(48.1, 11.5, at=datetime(2026, 11, 23, 7, 43, 14, 250_000, timezone.utc), lamps=Lamps.low | Lamps.high,
                         path=[(1.0, 2.0)], by={3: "x"})
        text = written(value)
        self.assertEqual(text, '{"lat":48.1,"lon":11.5,"class":"car","gear":"park","lamps":3,"level":"one",'
                               '"at":"2026-11-23T07:43:14.25Z","took":"PT1.5S","path":[[1.0,2.0]],"by":{"3":"x"},"kind":"a"}')
        self.assertEqual(from_json(json.loads(text), Position), value)
        tree = Tree("a", [Tree("b")])
        self.assertEqual(from_json(json.loads(written(tree)), Tree), tree)

    def test_what_may_be_missing_and_what_is_not_known(self):
        self.assertEqual(from_json({"lat": 1, "lon": 2, "new": [1]}, Position), Position(1.0, 2.0))
        self.assertTrue(math.isnan(from_json({"lat": 1, "lon": None}, Position).lon))

    def test_errors_name_the_path(self):
        for text, says in (('{"lon":1}', "lat: is missing"), ('{"lat":"1","lon":1}', "lat: expected a number, got a string"),
                           ('{"lat":91,"lon":1}', "lat: 91"), ('{"lat":true,"lon":1}', "lat: expected a number, got a boolean"),
                           ('{"lat":1,"lon":1,"path":[[1,2],[1]]}', r"path\[1\]: expected an array of 2"),
                           ('{"lat":1,"lon":1,"path":{}}', "path: expected an array, got an object"),
                           ('{"lat":1,"lon":1,"gear":"fly"}', "gear: expected one of park, drive"),
                           ('{"lat":1,"lon":1,"lamps":8}', "lamps: 8"), ('{"lat":1,"lon":1,"by":{"x":"y"}}', "'x' is not an integer"),
                           ('{"lat":1,"lon":1,"at":"noon"}', "at: expected a time"), ("[]", "expected an object, got an array"),
                           ('{"lat":1,"lon":1,"took":"1 s"}', "took: expected a duration"),
                           ('{"lat":1,"lon":1,"kind":"c"}', "kind: expected one of a, b")):
            with self.assertRaisesRegex(ConversionError, says, msg=text):
                from_json(json.loads(text), Position)

    def test_times(self):
        for text, expected in (("P1DT12H", timedelta(hours=36)), (1.5, timedelta(seconds=1.5)), ("-PT3S", timedelta(seconds=-3)),
                               ("P2W", timedelta(weeks=2))):
            self.assertEqual(from_json(text, timedelta), expected)
        for text in ("2026-11-23T08:43:14.250000000+01:00", 1795419794.25):
            self.assertEqual(from_json(text, datetime), datetime(2026, 11, 23, 7, 43, 14, 250_000, timezone.utc))
        self.assertEqual(written(timedelta(microseconds=-1)), '"-PT0.000001S"')
        with self.assertRaisesRegex(ConversionError, "without a zone"):
            written(datetime(2026, 1, 1))

    def test_scalars_are_enclosed(self):
        self.assertEqual(from_json({"value": 3}, int, is_content=True), 3)
        self.assertEqual(from_json({}, int | None, is_content=True), None)
        with self.assertRaisesRegex(ConversionError, "expected an integer"):
            from_json({"value": 3.5}, int, is_content=True)
        with self.assertRaisesRegex(ConversionError, "value: is missing"):
            from_json({"v": 3}, int, is_content=True)

    def test_what_has_no_form(self):
        for value in (object(), b"x", Position(200.0, 0.0)):
            with self.assertRaises((ConversionError, jsontext.Invalid)):
                written(value)


class Schemas(unittest.TestCase):
    def test_of_types(self):
        for hint, expected in ((float, {"type": "object", "properties": {"value": {"type": ["number", "null"]}},
                                        "required": ["value"]}),
                               (list[int], {"type": "array", "items": {"type": "integer"}}), (None, {"type": "object",
                                                                                                     "maxProperties": 0}),
                               (dict[str, bool], {"type": "object", "additionalProperties": {"type": "boolean"}}), (Any, {}),
                               (dict, {"type": "object"})):
            self.assertEqual(content_schema(hint), expected)
        told = content_schema(Position)["$defs"]["Position"]
        self.assertEqual(told["required"], ["lat", "lon"])
        self.assertEqual(told["properties"]["class"], {"type": "string", "default": "car"})
        self.assertEqual(told["properties"]["lat"]["unit"], "deg")
        self.assertEqual(content_schema(Tree)["$defs"]["Tree"]["properties"]["children"]["items"], {"$ref": "#/$defs/Tree"})


class Source(unittest.TestCase):
    def run_source(self, told):
        source = dataclasses_of(told)
        space: dict[str, Any] = {"__name__": __name__}
        exec(compile(source, "told.py", "exec"), space)  # noqa: S102
        return source, space

    def test_a_dataclass_comes_back(self):
        source, space = self.run_source([("target", {"PUSH": {"body": content_schema(Position), "result": content_schema(None)}}),
                                         ("trees", {"PULL": {"result": content_schema(Tree)}}),
                                         ("speed", {"PULL": {"result": content_schema(float)}})])
        self.assertIn("# PUSH target  body: Position\n# PULL trees  result: Tree\n# PULL speed  result: float\n", source)
        globals().update({name: made for name, made in space.items() if name == "Annotated"})
        made = from_json({"lat": 48.1, "lon": 11.5, "class": "x", "by": {"3": "y"}}, space["Position"])
        self.assertEqual((made.lat, made.class_, made.by), (48.1, "x", {3: "y"}))
        self.assertEqual(json.loads(written(made))["class"], "x")
        with self.assertRaisesRegex(ConversionError, "lat: 91"):
            from_json({"lat": 91, "lon": 0}, space["Position"])

    def test_what_a_peer_tells_does_no_harm(self):
        evil = {"type": "object", "properties": {"x: int\n    import os": {"type": "string", "description": "\"\"\"\n\x1b[2J"},
                                                 "class": {"type": "integer"}, "3d": {"enum": ["a'b", "c\nd"]}, "": {}},
                "required": ["class", 7]}
        source, space = self.run_source([("t\n", {"PUSH\x1b": {"body": evil, "result": 3}, "PULL": "x"})])
        self.assertNotIn("\x1b", source)
        self.assertNotIn("\n    import", source)
        self.assertEqual(json.loads(written(space["TBody"](1)))["class"], 1)
        wide = {"anyOf": [{"$ref": "#/$defs/a"}] * 50}
        dataclasses_of([("t", {"PUSH": {"body": {**wide, "$defs": {"a": wide}}}})])


if __name__ == "__main__":
    unittest.main()
