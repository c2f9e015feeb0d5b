"""Structures read from Gmsh files, results written for ParaView, pictures."""
