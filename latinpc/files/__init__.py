"""Structures read from files, results written for ParaView, pictures."""
