"""The operator's command line: ``perchhw VERB ...``.

Verbs live in modules of their own, imported only when their verb is called, so that ``--help`` stays fast.
"""
