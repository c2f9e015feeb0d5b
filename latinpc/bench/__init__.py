"""Measurements: tables of the article, comparisons with other solvers, the robustness suite."""
