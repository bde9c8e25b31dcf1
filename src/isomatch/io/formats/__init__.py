"""Mesh files: one module for each format, with a function that reads bytes and one that writes them."""
