"""Ports for servers that tests start, which nobody else takes before they do."""

import socket
from contextlib import ExitStack
from pathlib import Path


def held_ports(stack: ExitStack, number: int) -> list[int]:
    """Return ports of the loopback without a listener, held by this process until the stack is closed.

    They are below those that the system gives to whoever asks for any; among tests, the name of a socket holds each.
    """
    end = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])
    found: list[int] = []
    for port in range(end - 1, 1024, -1):
        if len(found) == number:
            break
        holder = stack.enter_context(socket.socket(socket.AF_UNIX))
        try:
            holder.bind(f"\0feti-homog test port {port}")
            with socket.create_server(("127.0.0.1", port)):
                found.append(port)
        except OSError:
            holder.close()
    return found
