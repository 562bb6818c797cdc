"""What a person is led through at the bench: plan, record, judge, repeat, fit, report, compare, apply."""
