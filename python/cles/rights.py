# SPDX-License-Identifier: BSL-1.0
"""Rights and local rules of a fleet's members (docs/protocol_security.md, "Rights"; docs/security.md, "Local rules")."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from urllib.parse import unquote_to_bytes

from .grammar import VERBS, Malformed, Noun, is_name, parse_noun

_EXEMPT = ("cancel", "hello", "leaving", "roster", "announced", "slots")


def matches(pattern: str, text: str) -> bool:
    """Of a name: `*` stands for any characters."""
    return _fits(tuple(pattern.split("*")), text)


def _fits(parts: tuple[str, ...], text: str) -> bool:
    """Whether the text consists of these parts with any characters between them. Linear in the length of the text, unlike a
    regular expression."""
    first, *others = parts
    if not others:
        return first == text
    last = others.pop()
    if not text.startswith(first):
        return False
    at = len(first)
    for part in others:
        at = text.find(part, at)
        if at < 0:
            return False
        at += len(part)
    return len(text) - at >= len(last) and text.endswith(last)


def is_name_pattern(text: str) -> bool:
    return bool(text) and "**" not in text and all(not part or is_name(part) for part in text.split("*"))


@dataclass(frozen=True, slots=True)
class Right:
    """`VERBS NOUN`, compiled."""

    verbs: frozenset[str]
    target: str
    task: str
    parameters: tuple[tuple[str, ...], ...]  # of each, what is between two `*`, decoded
    further: bool

    def permits(self, verb: str, target: str, noun: Noun) -> bool:
        given = noun.parameters
        if verb not in self.verbs or len(given) < len(self.parameters) or \
                (len(given) > len(self.parameters) and not self.further):
            return False
        return matches(self.target, target) and matches(self.task, noun.task) and \
            all(_fits(wanted, text) for wanted, text in zip(self.parameters, given))


def parse_right(text: str) -> Right | None:
    """None if it is of another form: it permits nothing."""
    words, space, noun = text.partition(" ")
    if not space:
        return None
    names = {verb.lower(): verb for verb in VERBS}
    verbs = [names.get(word, "") for word in words.split(",")] if words != "*" else list(VERBS)
    further = noun.endswith("/**")
    target, colon, path = noun.removesuffix("/**").partition(":")
    task, *parameters = path.split("/")
    if "" in verbs or not colon or target in ("self", "any", "all") or not is_name_pattern(target) or \
            not is_name_pattern(task) or len(parameters) > 32:
        return None
    compiled = []
    for parameter in parameters:
        parts = parameter.split("*")
        if not parameter or "**" in parameter or not all(map(_is_literal, parts)):
            return None
        compiled.append(tuple(unquote_to_bytes(part).decode() for part in parts))
    return Right(frozenset(verbs), target, task, tuple(compiled), further)


def _is_literal(part: str) -> bool:
    try:
        return not part or bool(parse_noun(f"x:x/{part}").parameters)
    except Malformed:
        return False


@dataclass(frozen=True, slots=True)
class Rule:
    allows: bool
    name: str
    about: str  # `may` or `offers`
    right: Right


@dataclass(frozen=True, slots=True)
class Rules:
    """The node's own rules, which only narrow the roster's. With `error`, everything is denied."""

    rules: Sequence[Rule] = ()
    error: str = ""

    def find(self, requester: str, verb: str, target: str, noun: Noun) -> Rule | None:
        for rule in self.rules:
            name = requester if rule.about == "may" else target
            if name and rule.right.permits(verb, target, noun) and matches(rule.name, name):
                return rule
        return None


def parse_rules(text: bytes) -> Rules:
    if len(text) > 65_536:
        return Rules(error="it has more than 65536 bytes")
    rules: list[Rule] = []
    for number, line in enumerate(text.decode("utf-8", "replace").split("\n"), 1):
        words = [word for word in re.split(r"[ \t]+", line.partition("#")[0].removesuffix("\r")) if word]
        if not words:
            continue
        right = parse_right(f"{words[3]} {words[4]}") if len(words) == 5 else None
        if right is None or words[0] not in ("allow", "deny") or words[2] not in ("may", "offers") or \
                not is_name_pattern(words[1]) or words[1] in ("self", "any", "all"):
            return Rules(error=f"line {number}: a rule has the form 'allow|deny NAME may|offers VERBS NOUN'")
        if len(rules) == 1000:
            return Rules(error=f"line {number}: more than 1000 rules")
        rules.append(Rule(words[0] == "allow", words[1], words[2], right))
    return Rules(rules)


class Rights:
    """A list in the roster. Without one, everything is permitted."""

    def __init__(self, listed: Iterable[str] | None) -> None:
        self._rights = None if listed is None else [right for text in listed if (right := parse_right(text))]

    def permits(self, verb: str, target: str, noun: Noun) -> bool:
        return self._rights is None or any(right.permits(verb, target, noun) for right in self._rights)


def is_exempt(noun: Noun) -> bool:
    """Cancelling, learning the roster, and confirming an epoch."""
    return noun.task == "cles" and bool(noun.parameters) and noun.parameters[0] in _EXEMPT
