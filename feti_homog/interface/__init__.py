"""Imperfect bonding: which interface multipliers act."""
