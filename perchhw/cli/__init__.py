"""The operator's command line: ``perchhw VERB ...``."""
