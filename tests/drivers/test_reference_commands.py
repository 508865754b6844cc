"""`feti-homog keys`, and commands that are gone."""

import pytest
from support.command_line import command_line


def test_keys_of_all_sections():
    job = command_line(2, "keys")
    assert job.returncode == 0, job.stderr
    assert job.stdout.count("[cell]: ") == 1 and "  realisations\n" in job.stdout


def test_keys_of_a_section():
    job = command_line(1, "keys", "interface")
    assert job.returncode == 0 and job.stdout.startswith("[interface]: ")
    assert "an arc of [interface] debonded: " in job.stdout and "[cell]: " not in job.stdout


def test_keys_of_no_section():
    job = command_line(2, "keys", "cells")
    assert job.returncode == 2 and job.stderr.count("cells: unknown section; expected one of name, cell") == 1


@pytest.mark.parametrize("name", ["schema", "statistics"])
def test_commands_that_are_gone_name_the_way(name):
    job = command_line(0, name)
    assert (job.returncode, job.stdout) == (2, "") and job.stderr.startswith(
        f"error: command line: feti-homog {name} is "
    )
