"""A campaign: a grid of attempts, one after another, that survives a killed process (docs/campaigns.md)."""

from perchhw.campaign.database import CampaignError
from perchhw.campaign.file_table import CampaignFileError
from perchhw.campaign.forecast import forecast
from perchhw.campaign.grid_fit import check_approaches, fit_grid, flyable_part
from perchhw.campaign.plan import CampaignPlan, load_plan
from perchhw.campaign.run import CampaignStopped, run_campaign
from perchhw.campaign.store import AttemptRow, CampaignStore

__all__ = [
    "AttemptRow",
    "CampaignError",
    "CampaignFileError",
    "CampaignPlan",
    "CampaignStopped",
    "CampaignStore",
    "check_approaches",
    "fit_grid",
    "flyable_part",
    "forecast",
    "load_plan",
    "run_campaign",
]
