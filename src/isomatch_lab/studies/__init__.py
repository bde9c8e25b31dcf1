"""Studies: what the pages of the lab report, measured again; each is run by ``python -m isomatch_lab.studies.NAME``."""
