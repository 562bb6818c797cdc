"""Mutation of the safety code: every small change of it must be noticed by a test."""
