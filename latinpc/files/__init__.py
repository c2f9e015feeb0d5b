"""Structures read from files."""
