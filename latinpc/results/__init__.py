"""What is made of results: elongations and tensions, summaries, pictures, files for ParaView."""
