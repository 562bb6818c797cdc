"""Reports: self-contained HTML pages of runs and campaigns."""

from perchhw.report.campaign_report import write_campaign_report
from perchhw.report.run_report import write_run_report

__all__ = ["write_campaign_report", "write_run_report"]
