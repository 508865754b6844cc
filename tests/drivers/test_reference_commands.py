"""`feti-homog keys` and `schema`."""

from __future__ import annotations

import json

from support.command_line import command_line

from feti_homog.case.json_schema import json_schema


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


def test_schema():
    job = command_line(2, "schema")
    assert job.returncode == 0 and json.loads(job.stdout) == json_schema()
