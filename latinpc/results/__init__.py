"""Results of a solve: reactions, tables, summaries, pictures, files for ParaView."""
