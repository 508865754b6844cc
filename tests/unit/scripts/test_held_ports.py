"""Ports that tests give to servers belong to one test at a time."""

import socket
from contextlib import ExitStack
from pathlib import Path

from support.held_ports import held_ports


def test_ports_are_held_until_they_are_given_back():
    with ExitStack() as others:
        taken = held_ports(others, 2)
        with ExitStack() as ours, ExitStack() as theirs:
            first, second = held_ports(ours, 2), held_ports(theirs, 1)
            assert len({*taken, *first, *second}) == 5
            lowest = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])
            assert all(1024 < port < lowest for port in (*taken, *first, *second))
            with socket.create_server(("127.0.0.1", first[0])):
                pass
        with socket.create_server(("127.0.0.1", first[0])), ExitStack() as ours:
            assert held_ports(ours, 1)[0] not in (*taken, first[0])
