"""What a flight leaves: its columns, the file, tables of other tools, and the same flight again."""
