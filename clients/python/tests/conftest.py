"""A live service: VISAGE_SERVER is its address, VISAGE_SCANS a folder with scans and `rough.json`, their poses (`visage demo`)."""

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import visage


@pytest.fixture
def client() -> Iterator[visage.Client]:
    with visage.Client(os.environ["VISAGE_SERVER"]) as client:
        yield client


@pytest.fixture
def scans() -> Path:
    return Path(os.environ["VISAGE_SCANS"])


class BreakingLine:
    """A line to the service that breaks each time so many bytes were sent over it, so many times."""

    def __init__(self, server: str, after: int, times: int):
        address = urlsplit(server)
        self._target = (address.hostname, address.port)
        self._after = after
        self._left = times
        self.breaks = 0
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(self._target)
                threading.Thread(target=self._forward, args=(near, far), daemon=True).start()
                threading.Thread(target=self._backward, args=(far, near), daemon=True).start()

    def _forward(self, near: socket.socket, far: socket.socket) -> None:
        sent = 0
        with suppress(OSError):
            while chunk := near.recv(1 << 16):
                far.sendall(chunk)
                sent += len(chunk)
                if sent > self._after and self._left > 0:
                    self._left -= 1
                    self.breaks += 1
                    break
        self._end(near, far)

    def _backward(self, far: socket.socket, near: socket.socket) -> None:
        with suppress(OSError):
            while chunk := far.recv(1 << 16):
                near.sendall(chunk)
        self._end(near, far)

    @staticmethod
    def _end(*ends: socket.socket) -> None:
        for end in ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


@pytest.fixture
def breaking_line() -> Iterator[BreakingLine]:
    line = BreakingLine(os.environ["VISAGE_SERVER"], after=3_000_000, times=4)
    yield line
    line.close()
