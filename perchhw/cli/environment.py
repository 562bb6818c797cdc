"""Variables of the environment for what is the same every day: options beat them, they beat the lab file."""

DRONE_VARIABLE = "PERCHHW_DRONE"
LAB_VARIABLE = "PERCHHW_LAB"
MOCAP_VARIABLE = "PERCHHW_MOCAP"
POLICY_VARIABLE = "PERCHHW_POLICY"
VEHICLE_VARIABLE = "PERCHHW_VEHICLE"
LEGS_VARIABLE = "PERCHHW_LEGS"
