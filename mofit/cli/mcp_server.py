"""The commands as tools of an MCP server on standard input and output; needs the extra ``mofit[mcp]``."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable, Sequence

import anyio
import mcp_types as types
from anyio.abc import ByteReceiveStream, Process
from jsonschema import Draft202012Validator
from mcp.server import Server, ServerRequestContext
from mcp.server.stdio import stdio_server

from mofit import __version__
from mofit.cli.tools import TOOLS, command_line, description, input_schema

#: Seconds between two messages of progress: clients give up on a call that is silent, most after a minute.
_PROGRESS = 5.0
#: Seconds that an interrupted command has to put its files in order.
_PATIENCE = 10.0
_INSTRUCTIONS = (
    "mofit identifies dynamic models from test-bench data. The usual way: import measured files (first with guess, "
    "which proposes a map), check the campaign, identify a model, diagnose the gap that is left, design the next "
    "tests, predict other records. Numbers are in SI units. Paths are relative to the folder that the server runs in. "
    "Identify, diagnose and design take seconds to many minutes; time_limit bounds them."
)

Tell = Callable[[float, None, str], Awaitable[None]]


def serve() -> None:
    """Answer until standard input ends."""
    anyio.run(_serve)


async def _serve() -> None:
    server = Server(
        "mofit", version=__version__, instructions=_INSTRUCTIONS, on_list_tools=_list_tools, on_call_tool=_call_tool
    )
    async with stdio_server() as (incoming, outgoing):
        await server.run(incoming, outgoing, server.create_initialization_options())


async def _list_tools(
    context: ServerRequestContext, asked: types.PaginatedRequestParams | None
) -> types.ListToolsResult:
    tools = [types.Tool(name=name, description=description(name), input_schema=input_schema(name)) for name in TOOLS]
    return types.ListToolsResult(tools=tools)


async def _call_tool(context: ServerRequestContext, asked: types.CallToolRequestParams) -> types.CallToolResult:
    tool, values = asked.name, asked.arguments or {}
    if tool not in TOOLS:
        return _failed(f"mofit: there is no tool '{tool}'. Tools are {', '.join(TOOLS)}.")
    wrong = [error.message for error in Draft202012Validator(input_schema(tool)).iter_errors(values)]
    if wrong:
        return _failed(f"mofit: arguments of {tool}: {'; '.join(wrong)}.")
    code, printed, remarks = await _run(command_line(tool, values), context.session.report_progress)
    if not printed:
        return _failed(remarks or f"mofit: {tool} ended without a result, exit code {code}.")
    texts = [printed, remarks] if remarks else [printed]
    content = [types.TextContent(type="text", text=text) for text in texts]
    return types.CallToolResult(content=[*content], structured_content=json.loads(printed))


def _failed(message: str) -> types.CallToolResult:
    return types.CallToolResult(content=[types.TextContent(type="text", text=message)], is_error=True)


async def _run(arguments: Sequence[str], tell: Tell) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command in a process of its own.

    What a command prints never reaches the server's own output, and one that crashes costs one call. If the client
    cancels the call, the command is interrupted as by Ctrl-C.
    """
    command = [sys.executable, "-P", "-m", "mofit", *arguments]  # -P: as the script mofit, without the folder's modules
    printed, remarks = bytearray(), bytearray()
    async with await anyio.open_process(command, stdin=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            async with anyio.create_task_group() as reading:
                reading.start_soon(_read, process.stdout, printed)
                reading.start_soon(_read, process.stderr, remarks)
                async with anyio.create_task_group() as telling:
                    telling.start_soon(_tell, tell, arguments[0], remarks)
                    await process.wait()
                    telling.cancel_scope.cancel()
        except anyio.get_cancelled_exc_class():
            await _interrupt(process)
            raise
    assert process.returncode is not None
    return process.returncode, printed.decode().strip(), remarks.decode(errors="replace").strip()


async def _read(stream: ByteReceiveStream, into: bytearray) -> None:
    async for part in stream:
        into += part


async def _tell(tell: Tell, tool: str, remarks: bytearray) -> None:
    """Tell the client every few seconds that the command runs, for how long, and what it last said."""
    begin = anyio.current_time()
    while True:
        await anyio.sleep(_PROGRESS)
        last = remarks.decode(errors="replace").strip().rpartition("\n")[2]
        seconds = anyio.current_time() - begin
        await tell(round(seconds, 1), None, last or f"mofit {tool} has run for {seconds:.0f} s")


async def _interrupt(process: Process) -> None:
    if process.returncode is None:
        process.send_signal(signal.SIGINT)
        with anyio.move_on_after(_PATIENCE, shield=True):
            await process.wait()
