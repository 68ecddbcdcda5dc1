# SPDX-License-Identifier: BSL-1.0
"""Who may request what, by docs/protocol_security.md ("Rights") and docs/security.md ("Local rules"): written from these
alone, with regular expressions."""

from __future__ import annotations

import re
from urllib.parse import unquote_to_bytes

VERBS = ("pull", "push", "delegate", "bind", "update")
SEPARATOR = "\0"  # not in a decoded noun

VERB = "(?:" + "|".join(VERBS) + ")"
LETTER = r"[A-Za-z0-9_.-]"
NAME = rf"(?:{LETTER}|\*(?!\*))+"
PARAMETER = r"(?:[A-Za-z0-9_.~+-]|%[0-9A-Fa-f]{2}|\*(?!\*))+"
RIGHT = re.compile(rf"(\*|{VERB}(?:,{VERB})*) ({NAME}):({NAME})((?:/{PARAMETER})*)(/\*\*)?")
RULE = re.compile(rf"(allow|deny)[ \t]+({NAME})[ \t]+(may|offers)[ \t]+([^ \t]+)[ \t]+([^ \t]+)")
RESERVED = ("self", "any", "all")
EXEMPT = ("cancel", "hello", "leaving", "roster", "announced", "slots")


def decode(text: str) -> str:
    decoded = unquote_to_bytes(text).decode()  # raises UnicodeDecodeError, which is a ValueError
    if re.search(r"[\x00-\x1f\x7f-\x9f]", decoded):
        raise ValueError("a control character")
    return decoded


def wildcard(pattern: str, to_text=str) -> str:
    """The regular expression of a pattern within one part of a noun."""
    return f"[^{SEPARATOR}]*".join(re.escape(to_text(literal)) for literal in pattern.split("*"))


class Right:
    def __init__(self, text: str):
        match = RIGHT.fullmatch(text)
        if not match:
            raise ValueError(f"another form: {text}")
        verbs, target, task, parameters, further = match.groups()
        if target in RESERVED:
            raise ValueError("not the name of a node")
        self.verbs = VERBS if verbs == "*" else verbs.split(",")
        parts = [wildcard(target), wildcard(task)] + [wildcard(each, decode) for each in parameters.split("/")[1:]]
        if len(parts) > 34:
            raise ValueError("too many parameters")
        self.noun = re.compile(SEPARATOR.join(parts) + (f"(?:{SEPARATOR}[^{SEPARATOR}]*)*" if further else ""), re.DOTALL)

    def permits(self, verb: str, noun: str) -> bool:
        return verb in self.verbs and bool(self.noun.fullmatch(decoded(noun)))


def decoded(noun: str) -> str:
    target, path = noun.split(":")
    task, *parameters = path.split("/")
    return SEPARATOR.join([target, task] + [decode(each) for each in parameters])


def fits(name_pattern: str, name: str) -> bool:
    return bool(re.fullmatch(NAME, name_pattern)) and bool(re.fullmatch(wildcard(name_pattern), name))


def is_permitted(rights: list[str] | None, verb: str, noun: str) -> bool:
    def permits(text: str) -> bool:
        try:
            return Right(text).permits(verb, noun)
        except ValueError:
            return False

    return rights is None or any(permits(text) for text in rights)


def read_rules(text: str) -> list[tuple]:
    """(action, name, subject, right) of each line; raises ValueError if there is an error anywhere."""
    rules = []
    for line in text.split("\n"):
        line = re.sub(r"\r$", "", re.sub(r"#.*", "", line)).strip(" \t")
        if line:
            match = RULE.fullmatch(line)
            if not match or match.group(2) in RESERVED:
                raise ValueError(line)
            rules.append((*match.groups()[:3], Right(f"{match.group(4)} {match.group(5)}")))
    if len(rules) > 1000 or len(text.encode()) > 65536:
        raise ValueError("too much")
    return rules


def decide(scenario: dict, direction: str, requester: str, forwarder: str, verb: str, noun: str) -> str:
    """A letter: P permitted, X exempt; R, T, W: requester, target, forwarder are not members; N: may not forward; U: rules
    unreadable; D: a rule denies; M, O: `may` of the requester or `offers` of the target do not permit it."""
    members = scenario["members"]
    target = noun.split(":")[0]
    if direction == "sent":
        requester = scenario["self"]
    if direction == "delivered":
        verb = "bind"
    for name, letter in ((requester, "R"), (target, "T")):
        if name not in members:
            return letter
    if forwarder:
        if forwarder not in members:
            return "W"
        patterns = members[forwarder].get("forwards", [])
        if forwarder != requester and not any(fits(pattern, requester) for pattern in patterns):
            return "N"
    if re.match(rf"{re.escape(target)}:cles/({'|'.join(EXEMPT)})(/|$)", noun):
        return "X"
    try:
        rules = read_rules(scenario.get("rules", ""))
    except ValueError:
        return "U"
    for action, name, subject, right in rules:
        about = target if subject == "offers" else None if direction == "sent" else requester
        if about is not None and fits(name, about) and right.permits(verb, noun):
            if action == "deny":
                return "D"
            break
    if not is_permitted(members[requester].get("may"), verb, noun):
        return "M"
    return "P" if is_permitted(members[target].get("offers"), verb, noun) else "O"


DIRECTIONS = ("received", "delivered", "sent")


def rows_of(scenario: dict) -> dict[str, str]:
    """For each direction, requester, forwarder and verb the letters of all nouns."""
    rows = {}
    for direction in DIRECTIONS:
        for requester in scenario["peers"] if direction != "sent" else [scenario["self"]]:
            for forwarder in scenario["forwarders"]:
                for verb in VERBS if direction != "delivered" else ["bind"]:
                    rows[f"{direction} {requester} {forwarder or '-'} {verb}"] = "".join(
                        decide(scenario, direction, requester, forwarder, verb, noun) for noun in scenario["nouns"])
    return rows
