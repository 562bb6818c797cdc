#include "host.h"

#include "../core/battery.h"

void perch_host_sizes(uint32_t sizes[4]) {
  sizes[0] = sizeof(perch_core);
  sizes[1] = sizeof(perch_inputs);
  sizes[2] = sizeof(perch_view);
  sizes[3] = sizeof(perch_recorder);
}

void perch_host_step(perch_core *core, const perch_inputs *in, perch_view *view) {
  perch_step(core, in);
  view->outputs = core->outputs;
  view->snapshot = core->landing.snapshot;
  view->model = core->model;
}

perch_policy_status perch_host_policy(const perch_bank *bank, uint32_t length, uint32_t n, const perch_cues *cues,
                                      float *values, float *moments) {
  perch_policy policy;
  const perch_policy_status status = perch_parse_bundle(bank, length, &policy);
  if (status == PERCH_POLICY_ACTIVE) {
    for (uint32_t i = 0; i < n; i++) {
      values[i] = perch_trigger_value(&policy, &cues[i]);
      moments[i] = perch_action_moment(&policy, &cues[i]);
    }
  }
  return status;
}

void perch_host_cues(uint32_t n, const float (*in)[4], perch_cues *cues) {
  for (uint32_t i = 0; i < n; i++) {
    cues[i] = perch_optical_flow_cues(in[i][0], in[i][1], in[i][2], in[i][3]);
  }
}

void perch_host_control(const perch_vehicle *vehicle, uint32_t n, const perch_estimate *estimates,
                        const perch_vector *integrals, const perch_motion *targets, const float *yaws,
                        perch_wrench *wrenches) {
  for (uint32_t i = 0; i < n; i++) {
    wrenches[i] = perch_geometric_control(&estimates[i], &integrals[i], &targets[i], yaws[i], vehicle);
  }
}

void perch_host_level(const perch_vehicle *vehicle, uint32_t n, const perch_estimate *estimates,
                      const float *collectives, const float *yaws, perch_wrench *wrenches) {
  for (uint32_t i = 0; i < n; i++) {
    wrenches[i] =
        perch_attitude_control(&estimates[i].quaternion, &estimates[i].gyro, collectives[i], yaws[i], vehicle);
  }
}

void perch_host_lead(const perch_vehicle *vehicle, uint32_t n, const perch_wrench *wrenches, perch_vector *lagged,
                     float dt, perch_wrench *leading) {
  for (uint32_t i = 0; i < n; i++) {
    leading[i] = perch_lead_moments(&wrenches[i], &lagged[i], vehicle, dt);
  }
}

void perch_host_mix(const perch_vehicle *vehicle, uint32_t n, const perch_wrench *wrenches, float (*thrusts)[4]) {
  for (uint32_t i = 0; i < n; i++) {
    perch_mix(&wrenches[i], vehicle, thrusts[i]);
  }
}

void perch_host_flip(const perch_vehicle *vehicle, uint32_t n, const float *moments, float (*thrusts)[4]) {
  for (uint32_t i = 0; i < n; i++) {
    perch_flip_thrusts(moments[i], vehicle, thrusts[i]);
  }
}

void perch_host_duty(const perch_vehicle *vehicle, uint32_t n, const float *thrusts, const float *voltages,
                     float *duties) {
  for (uint32_t i = 0; i < n; i++) {
    duties[i] = perch_duty(vehicle, thrusts[i], voltages[i]);
  }
}

void perch_host_plan(uint32_t n, const perch_approach *approaches, perch_plan *plans) {
  for (uint32_t i = 0; i < n; i++) {
    plans[i] = perch_plan_approach(&approaches[i]);
  }
}

void perch_host_approach(const perch_plan *plan, uint32_t n, const float *times, float half_width,
                         perch_motion *motions, float *jerks) {
  for (uint32_t i = 0; i < n; i++) {
    motions[i] = perch_smooth_approach(plan, times[i], half_width, &jerks[i]);
  }
}

void perch_host_stopping(uint32_t n, const float (*in)[3], float *distances) {
  for (uint32_t i = 0; i < n; i++) {
    distances[i] = perch_stopping_distance(in[i][0], in[i][1], in[i][2]);
  }
}

void perch_host_model(const perch_vehicle *vehicle, uint32_t n, perch_flight_model *models, float dt) {
  for (uint32_t i = 0; i < n; i++) {
    perch_fly_model(&models[i], vehicle, dt);
  }
}

void perch_host_landing(perch_landing_memory *memory, const perch_landing_inputs *in, const perch_plan *plan,
                        const perch_vehicle *vehicle, perch_landing_output *output) {
  *output = perch_landing_step(memory, in, plan, vehicle);
}
