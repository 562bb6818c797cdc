#include "battery.h"

#include "vector.h"

#define FILTER_GAIN 0.01f    /* per ms */
#define LOWEST_VOLTAGE 2.0f  /* V: below it nothing is driven */
#define HIGHEST_VOLTAGE 16.0f
enum { NEWTON_STEPS = 30 };

float perch_filter_voltage(float filtered, float measured) {
  return isfinite(measured) ? filtered + FILTER_GAIN * (measured - filtered) : filtered;
}

/* Inverse of a V^2 + b V + c. */
static float quadratic_voltage(float a, float b, float c, float thrust) {
  return (-b + sqrtf(perch_max(0.0f, b * b + 4.0f * a * (thrust - c)))) / (2.0f * a);
}

/* Inverse of an increasing cubic: Newton's method kept inside a bracket. */
static float cubic_voltage(const float c[], float thrust) {
  if (thrust <= c[0]) {
    return 0.0f;
  }
  float low = 0.0f, high = HIGHEST_VOLTAGE, voltage = 2.0f;
  for (int i = 0; i < NEWTON_STEPS; i++) {
    const float excess = c[0] + voltage * (c[1] + voltage * (c[2] + voltage * c[3])) - thrust;
    if (excess > 0.0f) {
      high = voltage;
    } else {
      low = voltage;
    }
    const float slope = c[1] + voltage * (2.0f * c[2] + voltage * 3.0f * c[3]);
    float next = slope > 0.0f ? voltage - excess / slope : low;
    if (!(low < next && next < high)) {
      next = 0.5f * (low + high);
    }
    if (fabsf(next - voltage) < 1e-6f) {
      return next;
    }
    voltage = next;
  }
  return voltage;
}

/* Logarithms of two regions. */
static float log_voltage(const float c[], float thrust) {
  if (thrust <= c[4]) {
    return c[0] * logf(1.0f + thrust / c[1]);
  }
  return c[0] * logf(1.0f + c[4] / c[1]) + c[2] * logf((thrust + c[3]) / (c[4] + c[3]));
}

float perch_voltage_from_thrust(const perch_vehicle *vehicle, float thrust) {
  const float *c = vehicle->thrust_map;
  if (!(thrust > 0.0f)) {
    return 0.0f;
  }
  switch ((int)vehicle->thrust_map_form) {
    case PERCH_QUADRATIC_INVERSE:
      return thrust <= c[6] ? perch_max(0.0f, quadratic_voltage(c[0], c[1], c[2], thrust))
                            : quadratic_voltage(c[3], c[4], c[5], thrust);
    case PERCH_FIRMWARE_CUBIC:
      return cubic_voltage(c, thrust);
    default:
      return log_voltage(c, thrust);
  }
}

float perch_duty(const perch_vehicle *vehicle, float thrust, float battery_voltage) {
  if (!(thrust > vehicle->thrust_min) || !(battery_voltage >= LOWEST_VOLTAGE)) {
    return 0.0f;
  }
  return perch_min(perch_voltage_from_thrust(vehicle, thrust) / battery_voltage, 1.0f);
}
