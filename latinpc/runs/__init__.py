"""Runs of scenes: solve, motion, checkpoint, and their reports."""
