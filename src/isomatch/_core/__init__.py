"""What every subpackage stands on: errors, arrays, settings, files, threads, memory. Private to isomatch."""
