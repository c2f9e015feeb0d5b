"""Structures and results of which each rank has its own part."""
