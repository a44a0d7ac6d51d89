"""The server: one page and its files, one websocket for each page, on this machine only.

Other sites that are open in the same browser cannot talk to it: the Host header must name this server, which
a name that was bound to 127.0.0.1 from outside does not, and a websocket's Origin too.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import signal
import socket
import sys
import tempfile
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from functools import cache, partial
from itertools import count
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from fastmech.errors import InputError, one_line
from fastmech.explore.device import Device
from fastmech.explore.messages import LONGEST, read_message
from fastmech.explore.work import MODULES, load, replies
from fastmech.interrupts import Cancelled, still_wanted, work_while

PAGE = Path(__file__).parent / "page"

#: Values of a variable that are shown where nothing is drawn.
SHOWN = 24

#: Answers that wait for a page, seconds that they do, and kernels of all views of a scene, about.
WAITING, PATIENCE, KERNELS = 64, 10.0, 15

#: What a browser may load: this server's files alone, and no code but them.
POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; base-uri 'none';"
POLICY += " img-src 'self' blob: data:; form-action 'none'; frame-ancestors 'none'"
HEADERS = ((b"content-security-policy", POLICY.encode()), (b"x-content-type-options", b"nosniff"))


class _OnlyHere:
    """Refuses whoever does not call this server by its own name."""

    def __init__(self, app: Any, port: int) -> None:
        self._app, self._hosts = app, {f"{host}:{port}" for host in ("127.0.0.1", "localhost")}

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers, talks = Headers(scope=scope), scope["type"] == "websocket"
        own = {f"http://{host}" for host in self._hosts} | (set() if talks else {None})
        if headers.get("host") not in self._hosts or headers.get("origin") not in own:
            refused = PlainTextResponse("fastmech explore answers this machine only\n", 403)
            await (WebSocket(scope, receive, send).close(1008) if talks else refused(scope, receive, send))
            return

        async def guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *HEADERS, (b"cache-control", b"no-store")]
            await send(message)

        await self._app(scope, receive, guarded)


class Page:
    """The work for one open page: of each kind one thread, which does the newest message only."""

    def __init__(self, device: Device, send: Callable[[str | bytes], None]) -> None:
        self._device, self._send = device, send
        self._newest, self._waiting, self.busy = dict[str, int](), dict[str, Any](), set[str]()
        self._counter, self._lock = count(), threading.Lock()

    def take(self, text: str | bytes) -> None:
        """Begin what a message asks for; what is wrong with it is told to the page.

        Raises:
            InputError: it is no message.
        """
        message = read_message(text)
        kind = message.what if message.kind == "stop" else message.kind
        with self._lock:
            self._newest[kind] = next(self._counter)
            self._waiting[kind] = message
            if message.kind == "stop":
                del self._waiting[kind]
            elif kind not in self.busy:
                self.busy.add(kind)
                threading.Thread(target=self._work, args=(kind,), name=kind, daemon=True).start()

    def close(self) -> None:
        """End all work."""
        with self._lock:
            self._newest.clear()
            self._waiting.clear()

    def _wants(self, kind: str, number: int | None) -> bool:
        return self._newest.get(kind) == number

    def _work(self, kind: str) -> None:
        while True:
            with self._lock:
                message, number = self._waiting.pop(kind, None), self._newest.get(kind)
                if message is None:
                    self.busy.discard(kind)
                    return
            work_while(partial(self._wants, kind, number))
            try:
                for content in replies(self._device, message):
                    self._send(content)
            except Cancelled:
                pass
            except Exception as error:  # whatever goes wrong, the page says so and the server goes on
                line = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
                self._send(_error(line, of=kind, id=message.id))


def _error(line: str, **about: Any) -> str:
    return json.dumps({"kind": "error", "line": one_line(line), **about})


def application(device: Device, port: int) -> Starlette:
    """The server's application."""
    pages, kernels = dict[Callable[..., None], Page](), list[str]()

    def compiling(name: str | None) -> None:
        kernels.extend([name] if name else [])
        own = getattr(still_wanted(), "args", [""])[0]  # the view, which some threads that it starts know
        of = [own] if own else sorted({kind for page in list(pages.values()) for kind in list(page.busy)})
        told: dict[str, Any] = {"kind": "compiling", "name": name, "of": of}
        told |= {"number": len(kernels), "about": max(KERNELS, len(kernels))}
        for send in list(pages):
            send(json.dumps(told), 0.0)

    def prepare() -> None:
        from fastmech.jit import listeners

        listeners.append(compiling)
        for kind in MODULES:
            load(kind)

    @asynccontextmanager
    async def listening(app: Starlette) -> AsyncIterator[None]:
        threading.Thread(target=prepare, daemon=True).start()
        yield
        if device.results:
            shutil.rmtree(folder, ignore_errors=True)

    async def sections(request: Request) -> Response:
        """Names of the result file's sections, or what is shown of one, by its number."""
        of, number = device.results, request.path_params.get("number")
        try:
            told = (_sections, of) if number is None else (_section, of, folder, number)
            return JSONResponse(of and await asyncio.to_thread(*told))
        except InputError as error:
            return JSONResponse({"error": str(error)}, 400)

    async def talk(websocket: WebSocket) -> None:
        await websocket.accept()
        loop, queue = asyncio.get_running_loop(), asyncio.Queue[str | bytes](WAITING)

        def send(content: str | bytes, patience: float = PATIENCE) -> None:
            """Called by threads; a page that takes nothing is not waited for endlessly."""
            with suppress(RuntimeError, TimeoutError):
                asyncio.run_coroutine_threadsafe(queue.put(content), loop).result(patience)

        async def deliver() -> None:
            while True:
                content = await queue.get()
                kind = "text" if isinstance(content, str) else "bytes"
                await websocket.send({"type": "websocket.send", kind: content})

        page, delivery = Page(device, send), asyncio.create_task(deliver())
        pages[send] = page
        await queue.put(json.dumps({"kind": "about", **device.about()}))
        try:
            while (got := await websocket.receive())["type"] != "websocket.disconnect":
                try:
                    page.take(got.get("text") or got.get("bytes") or "")
                except InputError as error:
                    await queue.put(_error(str(error)))
        finally:
            del pages[send]
            page.close()
            delivery.cancel()

    folder = Path(tempfile.mkdtemp(prefix="fastmech-explore-")) if device.results else PAGE
    routes: list[Any] = [Route("/sections", sections), Route("/sections/{number:int}", sections)]
    routes += [WebSocketRoute("/talk", talk)]
    files = {"/pictures": StaticFiles(directory=folder), "/": StaticFiles(directory=PAGE, html=True)}
    routes += [Mount(path, served) for path, served in files.items()]
    return Starlette(routes=routes, middleware=[Middleware(_OnlyHere, port=port)], lifespan=listening)


def _sections(path: Path) -> list[dict[str, Any]]:
    """Names of the sections of a result file, with lines and the request that give them again."""
    from fastmech.store.read import open_results

    with open_results(path) as results:
        names, request = list(results), results.request
    python = f"import fastmech as fm\n\nwith fm.open_results({str(path)!r}) as results:\n    print(results["
    return [{"name": n, "python": f"{python}{n!r}].to_xarray())\n", "request": request} for n in names]


@cache
def _section(path: Path, folder: Path, number: int) -> dict[str, Any]:
    """Pictures of a section, drawn when they are asked for first; its numbers where nothing is drawn."""
    from fastmech.runner import draw_results
    from fastmech.store.read import open_results

    with open_results(path) as results:
        if number >= len(names := list(results)):
            raise InputError(f"{path}: has no section {number}")
        section, pictures, line, numbers = results[names[number]], list[str](), "", list[list[str]]()
        try:
            drawn = draw_results(path, folder / str(number), form="svg", section=names[number])
            pictures = [f"{number}/{one.name}" for one in drawn]
        except InputError as error:  # of this section alone
            line = str(error)
        for name, one in section.items() if line else ():
            values = [
                f"{v:.6g}" if isinstance(v, float) else str(v) for v in one.data.ravel()[:SHOWN].tolist()
            ]
            values += ["and more"] if one.data.size > SHOWN else []
            numbers.append([name, one.units, ", ".join(values), one.long_name])
    return {"pictures": pictures, "line": line, "numbers": numbers}


def serve(device: Device, port: int, ready: Callable[[str], None]) -> None:
    """Serve until Ctrl-C; ``ready`` is given the page's address.

    Raises:
        InputError: the port is taken.
    """
    import uvicorn

    try:
        own = socket.create_server(("127.0.0.1", port))
    except OSError as error:
        raise InputError(f"--port {port}: cannot be used: {error.strerror}") from None
    port = own.getsockname()[1]
    how: dict[str, Any] = {"log_level": "critical", "ws": "websockets-sansio", "ws_max_size": 4 * LONGEST}
    config = uvicorn.Config(application(device, port), timeout_graceful_shutdown=0, **how)
    # The page's files are served while the libraries are imported: threads take turns that often [s].
    sys.setswitchinterval(5e-4)
    # At once: a kernel that is being compiled or runs would hold the process.
    signal.signal(signal.SIGINT, lambda *_: os._exit(0))
    ready(f"http://127.0.0.1:{port}/")
    uvicorn.Server(config).run(sockets=[own])
    os._exit(0)
