/* Battery compensation: which share of the voltage gives a motor its thrust (onboard/battery.py). */
#ifndef PERCH_BATTERY_H
#define PERCH_BATTERY_H

#include "vehicle.h"

/* V of a full cell: where the filter begins. */
#define PERCH_FULL_VOLTAGE 4.2f

/* The low-passed battery voltage (V) one ms later. */
float perch_filter_voltage(float filtered, float measured);

/* Voltage (V) at the motor that gives `thrust` (N); 0 for a thrust of 0, below, or NaN. */
float perch_voltage_from_thrust(const perch_vehicle *vehicle, float thrust);

/* Share (0..1) of the battery voltage that gives a motor `thrust` (N); 0 for what is not a number. */
float perch_duty(const perch_vehicle *vehicle, float thrust, float battery_voltage);

#endif
