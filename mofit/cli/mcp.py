"""The command for programs that drive mofit: mcp."""

from __future__ import annotations

from mofit.cli.app import DONE, app
from mofit.errors import InputError


@app.command
def mcp() -> int:
    """Serve check, import, identify, diagnose, design and predict as tools of the Model Context Protocol.

    It speaks the protocol on standard input and output: a program starts it, people do not. It needs mofit[mcp].

    Example: mofit mcp
    """
    try:
        from mofit.cli.mcp_server import serve
    except ModuleNotFoundError as error:
        hint = "Install mofit's extra: pip install 'mofit[mcp]'"
        raise InputError.of("mofit mcp", f"needs the package {error.name}", hint) from None
    serve()
    return DONE
