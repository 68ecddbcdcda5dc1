# SPDX-License-Identifier: BSL-1.0
"""Writes vectors.json: values of every format of docs/protocol_security.md, made from fixed keys, for other implementations.

    make_vectors.py         prints the vectors
    make_vectors.py --add   prints those of vectors.json, and those that are not in it yet
"""

import hashlib
import json
import sys
from pathlib import Path

import reference as r
from nacl import bindings as sodium


def seed(name: str) -> bytes:
    return hashlib.sha256(f"cles test vector {name}".encode()).digest()


fleet, car1, car2 = (r.Identity(seed(name)) for name in ("fleet", "car1", "car2"))
current, following = seed("current group key"), seed("next group key")


def sealed_for(receiver: r.Identity) -> str:
    """A sealed box draws a key of its own each time, so the vectors are made once and kept."""
    return r.text(sodium.crypto_box_seal(current + following, receiver.dh_public))


roster = r.sign_roster(fleet, {
    "fleet": r.text(fleet.public), "version": 7, "last": 3, "generation": 5, "oldest": 4, "keys": sealed_for(fleet),
    "members": [
        {"number": 1, "name": "car1", "key": r.text(car1.public), "keys": sealed_for(car1)},
        {"number": 3, "name": "car2", "key": r.text(car2.public), "keys": sealed_for(car2),
         "may": ["pull,bind *:localization", "push car1:target"], "forwards": ["sat*"]},
    ]})

index1, index2 = seed("index of car1")[:8], seed("index of car2")[:8]
salt1, salt2 = seed("salt of car1")[:16], seed("salt of car2")[:16]
start = r.head(r.HELLO, 1) + index1
shared = r.prologue(fleet.public, 3, start)
initiator = r.Handshake(car1, car2.public, True, shared, seed("ephemeral of car1"))
responder = r.Handshake(car2, car1.public, False, shared, seed("ephemeral of car2"))
hello = start + initiator.write(r.hello_payload(7, "0a0b0c0d", salt1, 41))
responder.read(hello[12:])
welcome = r.head(r.WELCOME, 3) + index1 + responder.write(r.welcome_payload(index2, 7, "5f3a09c1", salt2, 17))
initiator.read(welcome[12:])
(sending, receiving) = initiator.split()
line = "PULL car2:localization id=5"
reply = 'id=5 {"utc":2}'
pool_subject, pool_reply, pool_message = "cles.a.pull.car1.speed", "cles.b.reply.1", "PULL car1:speed/front {}"
instance1, instance2 = r.instance(1, salt1), r.instance(3, salt2)
session_prologue = r.session_prologue(fleet.public, instance1, instance2, index1)
session_initiator = r.Handshake(car1, car2.public, True, session_prologue, seed("ephemeral of car1"))
session_responder = r.Handshake(car2, car1.public, False, session_prologue, seed("ephemeral of car2"))
session_hello = session_initiator.write(b"")
session_responder.read(session_hello)
session_welcome = session_responder.write(index2)
session_initiator.read(session_welcome)
session_key = session_initiator.split()[0]
session_subject = f"cles.b.bridge.{instance2:016x}.request"
session_reply = f"cles.a.bridge.{instance1:016x}.7"
update = 'UPDATE car2:localization seq=17 epoch=5f3a09c1 {"utc":2}'
announced = ('{"node":"car2","endpoints":["tls://10.0.0.3:25370"],"interval_ms":1000,"tasks":"85944171f73967e8",'
             '"signed":["localization"],"roster":7}')
challenge = r.text(seed("challenge of car1")[:16])
request = ("car1", "car2", r.text(seed("challenge")[:16]), "delegate", "strike/now", '{"track":3}', 4900)


def signed_update(noun: str, seq: int, body: str) -> str:
    return r.text(car2.sign(r.update_to_sign(fleet.public, "car2", noun, seq, "5f3a09c1", body)))


def signed_request(following: bytes) -> dict:
    signature = car1.sign(r.request_to_sign(fleet.public, *request, following))
    return {"requester": "car1", "node": "car2", "challenge": request[2], "verb": "DELEGATE", "noun": "strike/now",
            "body": request[5], "waits_ms": request[6], "bytes": following.decode(),
            "sig": f"{r.text(signature)}.{request[6]}"}


vectors = {
    "keys": {name: {"seed": seed(name).hex(), "public": who.public.hex(), "x25519_public": who.dh_public.hex()}
             for name, who in (("fleet", fleet), ("car1", car1), ("car2", car2))},
    "fingerprint": r.fingerprint("car1", car1.public),
    "group_keys": {"current": current.hex(), "next": following.hex()},
    "roster": roster.decode(),
    "handshake": {
        "initiator": "car1", "responder": "car2", "prologue": shared.hex(),
        "ephemeral_secrets": [seed("ephemeral of car1").hex(), seed("ephemeral of car2").hex()],
        "hello": hello.hex(), "hello_mac": r.hello_mac(car1, car2.public, fleet.public, 1, 3, hello).hex(),
        "welcome": welcome.hex(), "hash": initiator.hash.hex(),
        "initiator_sends_with": sending.hex(), "responder_sends_with": receiving.hex(),
    },
    "data": [
        {"from": "car1", "counter": 0, "line": line, "datagram": r.seal_data(sending, 1, index2, 0, line.encode()).hex()},
        {"from": "car2", "counter": 9, "line": reply, "datagram": r.seal_data(receiving, 3, index1, 9, reply.encode()).hex()},
    ],
    "group": {"from": "car2", "generation": 5, "salt": salt2.hex(), "counter": 17, "line": update,
              "datagram": r.seal_group(current, 3, 5, salt2, 17, update.encode()).hex()},
    "pool": {"from": "car2", "generation": 5, "salt": salt2.hex(), "counter": 17, "instance": f"{r.instance(3, salt2):016x}",
             "subject": pool_subject, "reply": pool_reply, "message": pool_message,
             "sealed": r.seal_pool(current, fleet.public, car2, 3, 5, salt2, 17, pool_subject, pool_reply,
                                   pool_message.encode()).hex()},
    "pool_session": {"initiator": "car1", "responder": "car2", "instances": [f"{instance1:016x}", f"{instance2:016x}"],
                     "prologue": session_prologue.hex(),
                     "ephemeral_secrets": [seed("ephemeral of car1").hex(), seed("ephemeral of car2").hex()],
                     "hello_index": index1.hex(), "hello": r.session_question("hello", index1, session_hello),
                     "index": index2.hex(), "welcome": r.session_question("welcome", index1, session_welcome),
                     "key": session_key.hex(), "counter": 0, "subject": session_subject, "reply": session_reply,
                     "message": pool_message,
                     "sealed": r.seal_session(session_key, instance1, index2, 0, session_subject, session_reply,
                                              pool_message.encode()).hex()},
    "ask": {"from": "car1", "version": 7, "message": r.ask(1, 7).hex()},
    "given_roster": {"from": "car2", "to": "car1", "message": r.give_roster(3, car1.public, roster).hex()},
    "signed_request": signed_request(b""),
    "signed_request_with_bytes": signed_request(b"hello"),
    "signed_update": {"publisher": "car2", "noun": "localization", "seq": 17, "epoch": "5f3a09c1", "body": '{"utc":2}',
                      "sig": signed_update("localization", 17, '{"utc":2}')},
    "announced": {"node": "car2", "announced": announced, "seq": 18, "epoch": "5f3a09c1", "challenge": challenge,
                  "sig": signed_update("cles", 18, announced),
                  "sig_of_reply": signed_update(f"cles/announced/{challenge}", 18, announced)},
}
if sys.argv[1:] == ["--add"]: # what is drawn at random stays as it is
    kept = json.loads((Path(__file__).resolve().parent / "vectors.json").read_text())
    vectors = {name: kept.get(name, made) for name, made in vectors.items()}
print(json.dumps(vectors, indent=2))
