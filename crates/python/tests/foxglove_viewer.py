"""A viewer of Foxglove's protocol, as much of it as the tests need: topics, parameters, playback."""

from __future__ import annotations

import json
import re
import signal
import struct
import subprocess
import time
from dataclasses import dataclass, field
from typing import Any

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from websockets.sync.client import ClientConnection, connect

PROTOBUF: dict[str, Any] = {
    "foxglove.FrameTransform": FrameTransform,
    "foxglove.LocationFix": LocationFix,
    "foxglove.Log": Log,
}
PLAYING, PAUSED, BUFFERING, ENDED = range(4)


@dataclass
class State:
    """What the server says of its playback."""

    status: int
    time_ns: int
    speed: float
    has_jumped: bool
    request: str


@dataclass
class Viewer:
    """Connected; everything that comes is kept by kind."""

    socket: ClientConnection
    info: dict[str, Any] = field(default_factory=dict)
    channels: dict[int, dict[str, Any]] = field(default_factory=dict)
    messages: dict[str, list[tuple[int, Any]]] = field(default_factory=dict)
    parameters: dict[str, Any] = field(default_factory=dict)
    statuses: list[dict[str, Any]] = field(default_factory=list)
    states: list[State] = field(default_factory=list)
    time_ns: int = -1
    requests: int = 0

    def take(self, seconds: float = 0.05) -> bool:
        """The next message; false if none comes."""
        try:
            received = self.socket.recv(timeout=seconds)
        except TimeoutError:
            return False
        if isinstance(received, str):
            self._json(json.loads(received))
        else:
            self._binary(received)
        return True

    def _json(self, message: dict[str, Any]) -> None:
        match message["op"]:
            case "serverInfo":
                self.info = message
            case "advertise":
                new = [channel for channel in message["channels"] if channel["id"] not in self.channels]
                self.channels |= {channel["id"]: channel for channel in new}
                self._subscribe(new)
            case "parameterValues":
                self.parameters |= {p["name"]: p.get("value") for p in message["parameters"]}
            case "status":
                self.statuses.append(message)
                # The server's library (foxglove 0.30.3) tells of a channel a moment before it knows it itself.
                if unknown := re.fullmatch(r"Unknown channel ID: (\d+)", message["message"]):
                    self._subscribe([self.channels[int(unknown[1])]])

    def _subscribe(self, channels: list[dict[str, Any]]) -> None:
        """The subscription has the number of its channel."""
        self.send("subscribe", subscriptions=[{"id": c["id"], "channelId": c["id"]} for c in channels])

    def _binary(self, message: bytes) -> None:
        match message[0]:
            case 1:
                number, time_ns = struct.unpack_from("<IQ", message, 1)
                channel, payload = self.channels[number], message[13:]
                kind = PROTOBUF.get(channel["schemaName"])
                decoded = kind.FromString(payload) if kind else json.loads(payload)
                self.messages.setdefault(channel["topic"], []).append((time_ns, decoded))
            case 2:
                (self.time_ns,) = struct.unpack_from("<Q", message, 1)
            case 5:
                status, time_ns, speed, has_jumped, length = struct.unpack_from("<BQfBI", message, 1)
                request = message[19 : 19 + length].decode()
                self.states.append(State(status, time_ns, speed, bool(has_jumped), request))

    def send(self, op: str, **content: Any) -> None:
        self.socket.send(json.dumps({"op": op, **content}))

    def until(self, is_done: Any, seconds: float = 20.0) -> None:
        """Takes messages until something holds."""
        end = time.monotonic() + seconds
        while not is_done():
            assert time.monotonic() < end, f"waited in vain; states {self.states[-3:]}, statuses {self.statuses[-3:]}"
            self.take()

    def control(self, *, play: bool, speed: float = 1.0, seek_ns: int | None = None) -> State:
        """Plays, pauses or jumps, and waits for the answer."""
        self.requests += 1
        request = f"request-{self.requests}".encode()
        content = struct.pack("<BfBQI", 0 if play else 1, speed, seek_ns is not None, seek_ns or 0, len(request))
        self.socket.send(b"\x03" + content + request)
        answers: list[State] = []
        seen = len(self.states)

        def answered() -> bool:
            answers[:] = [s for s in self.states[seen:] if s.request == request.decode()]
            return bool(answers)

        self.until(answered)
        return answers[0]

    def whole(self) -> None:
        """Plays everything after the first instant, fast, but not faster than a viewer of Python keeps up with: then the oldest are dropped."""
        self.control(play=False, seek_ns=0)
        self.quiet()
        self.messages.clear()
        self.control(play=True, speed=10.0)
        self.until(lambda: self.states[-1].status == ENDED, 60.0)
        self.quiet()

    def quiet(self, seconds: float = 0.3) -> None:
        """Takes what is still on its way."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.take()


class Served:
    """A run behind a server."""

    def __init__(self, *words: object) -> None:
        self.process = subprocess.Popen(
            [*map(str, words), "--foxglove=127.0.0.1:0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.text = ""
        assert self.process.stdout
        for line in self.process.stdout:
            self.text += line
            if found := re.search(r"ws://\S+:\d+", line):
                self.address = found.group()
                return
        raise AssertionError(self.process.communicate()[1])

    def __enter__(self) -> Served:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.send_signal(signal.SIGINT)
        try:
            self.ended = self.process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise

    def viewer(self) -> Viewer:
        socket = connect(self.address, subprotocols=["foxglove.sdk.v1"], max_size=None, legacy=True)  # type: ignore[list-item]
        viewer = Viewer(socket)
        viewer.until(lambda: viewer.info and viewer.channels)
        return viewer
