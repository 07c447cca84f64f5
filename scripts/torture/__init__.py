"""Programs that try to break the program: mutated files, kills, long work and hostile systems."""
