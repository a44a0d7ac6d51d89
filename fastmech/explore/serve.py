"""The server: one page and its files, one websocket for each page, on this machine only.

Other sites that are open in the same browser cannot talk to it: the Host header must name this server, which
a name that was bound to 127.0.0.1 from outside does not, and a websocket's Origin too.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
import sys
import tempfile
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from fastmech.errors import InputError, one_line
from fastmech.explore.device import Device
from fastmech.explore.messages import LONGEST, read_message
from fastmech.explore.work import replies
from fastmech.jit import listeners

PAGE = Path(__file__).parent / "page"

#: What a browser may load: this server's files alone, and no code but them.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class _CancelledError(Exception):
    """Newer work has come, or the page is gone."""


class _OnlyHere:
    """Refuses whoever does not call this server by its own name."""

    def __init__(self, app: Any, port: int) -> None:
        self._app, self._hosts = app, {f"{host}:{port}" for host in ("127.0.0.1", "localhost")}

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        origin = headers.get("origin")
        own = {f"http://{host}" for host in self._hosts}
        right = headers.get("host") in self._hosts and (origin in own or origin is None)
        if scope["type"] == "websocket" and (not right or origin is None):
            await WebSocket(scope, receive, send).close(1008)
            return
        if not right:
            await PlainTextResponse("fastmech explore answers this machine only\n", 403)(scope, receive, send)
            return

        async def guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [
                    *message["headers"],
                    (b"content-security-policy", POLICY.encode()),
                    (b"x-content-type-options", b"nosniff"),
                    (b"cache-control", b"no-store"),
                ]
            await send(message)

        await self._app(scope, receive, guarded)


class _Page:
    """The work for one open page: of each kind the newest only."""

    def __init__(self, device: Device, send: Callable[[str | bytes], None]) -> None:
        self._device, self._send, self._newest = device, send, dict[str, int]()
        self._counter = 0

    def take(self, text: str | bytes) -> None:
        """Begin what a message asks for; what is wrong with it is told to the page."""
        try:
            message = read_message(text)
        except InputError as error:
            self.fail(str(error), {})
            return
        kind = message.what if message.kind == "stop" else message.kind
        self._counter += 1
        self._newest[kind] = self._counter
        if message.kind != "stop":
            threading.Thread(target=self._work, args=(message, self._counter), daemon=True).start()

    def close(self) -> None:
        """End all work."""
        self._newest.clear()

    def fail(self, line: str, about: dict[str, Any]) -> None:
        """Tell one line of error."""
        self._send(json.dumps({"kind": "error", "line": one_line(line), **about}))

    def _work(self, message: Any, number: int) -> None:
        def tell(finished: int) -> None:
            if self._newest.get(message.kind) != number:
                raise _CancelledError

        try:
            for content in replies(self._device, message, tell):
                tell(0)
                self._send(content)
        except _CancelledError:
            pass
        except InputError as error:
            self.fail(str(error), {"of": message.kind, "id": message.id})
        except Exception as error:  # whatever goes wrong, the page says so and the server goes on
            self.fail(f"{type(error).__name__}: {error}", {"of": message.kind, "id": message.id})


def application(device: Device, port: int) -> Starlette:
    """The server's application."""
    pages = set[Callable[[str | bytes], None]]()

    def compiling(name: str | None) -> None:
        for send in list(pages):
            send(json.dumps({"kind": "compiling", "name": name}))

    @asynccontextmanager
    async def listening(app: Starlette) -> AsyncIterator[None]:
        listeners.append(compiling)
        try:
            yield
        finally:
            listeners.remove(compiling)

    async def index(request: Request) -> Response:
        return Response((PAGE / "index.html").read_bytes(), media_type="text/html")

    async def sections(request: Request) -> Response:
        try:
            return JSONResponse(await asyncio.to_thread(_pictures, device, folder))
        except InputError as error:
            return JSONResponse({"error": str(error)}, 400)

    async def talk(websocket: WebSocket) -> None:
        await websocket.accept()
        loop, queue = asyncio.get_running_loop(), asyncio.Queue[str | bytes]()

        def send(content: str | bytes) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(queue.put_nowait, content)

        async def deliver() -> None:
            while True:
                content = await queue.get()
                if isinstance(content, str):
                    await websocket.send_text(content)
                else:
                    await websocket.send_bytes(content)

        page, delivery = _Page(device, send), asyncio.create_task(deliver())
        pages.add(send)
        send(json.dumps({"kind": "about", **device.about()}))
        try:
            while True:
                got = await websocket.receive()
                if got["type"] == "websocket.disconnect":
                    break
                page.take(got.get("text") or got.get("bytes") or "")
        except WebSocketDisconnect:
            pass
        finally:
            pages.discard(send)
            page.close()
            delivery.cancel()

    folder = Path(tempfile.mkdtemp(prefix="fastmech-explore-")) if device.results else PAGE
    routes = [
        Route("/", index),
        Route("/sections", sections),
        WebSocketRoute("/talk", talk),
        Mount("/page", StaticFiles(directory=PAGE)),
        Mount("/pictures", StaticFiles(directory=folder)),
    ]
    return Starlette(routes=routes, middleware=[Middleware(_OnlyHere, port=port)], lifespan=listening)


def _pictures(device: Device, folder: Path) -> list[str]:
    """Names of the pictures of a result file's sections, drawn when they are asked for first."""
    if device.results is None:
        return []
    there = sorted(path.name for path in folder.glob("*.svg"))
    if there:
        return there
    from fastmech.runner import draw_results

    return [path.name for path in draw_results(device.results, folder, form="svg")]


def serve(device: Device, port: int, ready: Callable[[str], None]) -> None:
    """Serve until Ctrl-C; ``ready`` is given the page's address.

    Raises:
        InputError: the port is taken.
    """
    own = socket.socket()
    own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        own.bind(("127.0.0.1", port))
    except OSError as error:
        raise InputError(f"--port {port}: cannot be used: {error.strerror}") from None
    port = own.getsockname()[1]
    config = uvicorn.Config(
        application(device, port), log_level="critical", ws="websockets-sansio", ws_max_size=LONGEST * 4,
        timeout_graceful_shutdown=0,
    )  # fmt: skip
    server = uvicorn.Server(config)
    own.listen()
    ready(f"http://127.0.0.1:{port}/")
    with suppress(KeyboardInterrupt):
        server.run(sockets=[own])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # a kernel that is being compiled or runs would hold the process
