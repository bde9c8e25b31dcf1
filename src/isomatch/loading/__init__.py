"""What is loaded only when it is used: public names, optional packages, compiled loops."""
